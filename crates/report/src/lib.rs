//! A journal becomes a run directory: readings, factors, BRDF, pictures, checks.

mod check;
mod checks;
mod directory;
mod error;
mod observation;
mod readings;
mod report;
mod run;

pub use check::{Check, Verdict};
pub use directory::RunDirectory;
pub use error::{ReportError, is_full};
pub use observation::{Observation, observe};
pub use readings::write_readings;
pub use report::{Report, reconstruct, write};
pub use run::{Given, Readings, Run, Seconds, State};
