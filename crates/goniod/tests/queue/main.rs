//! The daemon through its handle, on the built-in simulator.

mod bench;
mod jobs;
