//! The HTTP interface through a real listener, over the simulated rig.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

mod access;
mod documents;
mod exports;
mod history;
mod limits;
mod manual;
mod relay;
mod service;
mod slots;
mod unix;
mod work;
