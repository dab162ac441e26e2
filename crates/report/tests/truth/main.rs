//! Whole captures of known specimens on the simulated rig: what is reported must be true.

mod absolute;
mod bench;
#[path = "../../examples/campaign/campaign.rs"]
mod campaign;
mod coverage;
mod faults;
