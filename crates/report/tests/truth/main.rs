//! Whole captures of known specimens on the simulated rig: what is reported must be true.

mod absolute;
mod bench;
mod coverage;
mod flight;
mod range;
mod verdicts;
