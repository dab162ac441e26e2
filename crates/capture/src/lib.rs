//! Runs a plan on a rig: start, settle, read, flag, journal.
//!
//! The executor is one loop over the steps of a plan; the journal is what is true. Only tokio time is used, so a
//! whole capture runs under a paused clock against the in-process rig. Nothing here knows of reconstruction.

mod journal;
mod reading;

pub use journal::{Header, Journal, JournalError, Outcome, Record};
pub use reading::{Flag, Reading};
