//! End-to-end tests over the real executables, and what they share: running one, a simulator to run it against, and
//! reading back what it captured.

mod captured;
mod finished;
mod simulator;

pub use captured::{Captured, difference, entries};
pub use finished::{Finished, run};
pub use simulator::Simulator;
