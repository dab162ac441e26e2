//! The daemon through its handle, on the built-in simulator.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

mod adaptive;
mod bench;
mod faults;
mod jobs;
mod operator;
