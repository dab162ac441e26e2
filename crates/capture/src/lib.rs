//! Runs a plan on a rig: start, settle, read, flag, journal.
//!
//! The executor is one loop over the steps of a plan; the journal is what is true. Only tokio time is used, so a
//! whole capture runs under a paused clock against the in-process rig. Nothing here knows of reconstruction.

mod blur;
mod clock;
mod error;
mod event;
mod execution;
mod exposure;
mod file_journal;
mod flight;
mod journal;
mod mechanics;
mod memory_journal;
mod park;
mod progress;
mod reading;
mod run;
mod track;

pub use blur::{along, blur};
pub use error::{CaptureError, JournalError};
pub use event::{Command, Event, State};
pub use file_journal::FileJournal;
pub use journal::{Extension, Header, Journal, Outcome, Record, closed, extended_plan};
pub use mechanics::mechanics;
pub use memory_journal::MemoryJournal;
pub use reading::{Flag, Reading};
pub use run::{Ask, Thinking, run, run_and_ask};
