//! Whole captures of known specimens on the simulated rig: what is reported must be true.

mod absolute;
mod bench;
mod calibrated;
mod coverage;
mod flight;
mod gap;
mod light;
mod photometer;
mod range;
mod servos;
mod standards;
mod uncertainty;
mod verdicts;
mod wedge;
