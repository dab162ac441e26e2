//! A journal becomes a run directory: readings, factors, BRDF, pictures, checks.
//!
//! Everything but the journal is derived from it, written under a temporary name and renamed, and can be made again
//! with [`reconstruct`]. The crate knows nothing of buses, of motion, or of how a run came about.

mod adapt;
mod alignment;
mod check;
mod checks;
mod derive;
mod directory;
mod error;
mod export;
mod figures;
mod measurement;
mod model_uncertainty;
mod monte_carlo;
mod outline;
mod pace;
mod page;
mod picture;
mod plot;
mod preview;
mod readings;
mod report;
mod run;
mod sensitivity;
mod slice;
mod standard;
mod uncertainty;
mod wedge;

pub use adapt::{Adapted, extension};
pub use check::{Check, Verdict};
pub use derive::{Sweeps, model};
pub use directory::RunDirectory;
pub use error::{ReportError, is_full};
pub use export::{ExportedFile, RunExport};
pub use measurement::{Measurement, measurements, observations};
pub use model_uncertainty::{ModelUncertainty, UncertaintySummary};
pub use monte_carlo::MonteCarlo;
pub use pace::Pace;
pub use page::escape;
pub use picture::Picture;
pub use preview::{EXPOSURE as SPHERE_EXPOSURE, sphere};
pub use readings::write_readings;
pub use report::{
    LARGE, LARGE_BYTES, Report, UNCERTAINTY, Volume, judge, reconstruct, write, write_large, write_volume,
};
pub use run::{Given, GivenRig, Readings, Run, Seconds, State, Used, flag_name};
pub use standard::{Standard, WhiteReference};
pub use uncertainty::COVERAGE;
pub use wedge::{readings_on_wedge, wedge_readings};
