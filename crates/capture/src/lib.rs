//! Runs a plan on a rig: start, settle, read, flag, journal.
//!
//! The executor is one loop over the steps of a plan; the journal is what is true. Only tokio time is used, so a
//! whole capture runs under a paused clock against the in-process rig. Nothing here knows of reconstruction.

mod error;
mod file_journal;
mod journal;
mod reading;

pub use error::JournalError;
pub use file_journal::FileJournal;
pub use journal::{Header, Journal, Outcome, Record};
pub use reading::{Flag, Reading};
