//! End-to-end tests over the real executables, and what they share: running one, a simulator to run it against, and
//! reading back what it captured.

mod captured;
mod finished;
mod kills;
mod service;
mod simulator;

pub use captured::{Captured, difference, entries};
pub use finished::{Finished, on_a_full_disk, run, run_by};
pub use kills::{Tally, kills};
pub use service::Service;
pub use simulator::Simulator;
