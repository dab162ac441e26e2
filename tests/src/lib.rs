//! End-to-end tests over the real executables, and what they share: running one, and a simulator to run it against.

mod finished;
mod simulator;

pub use finished::{Finished, run};
pub use simulator::Simulator;
