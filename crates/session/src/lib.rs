//! A job file and a rig file become a run: read, checked, planned, captured and reported.
//!
//! [`RunRequest`] is both files, read and checked; [`run()`] carries one out in this process, [`resume`] goes on with a
//! run directory, and [`Calibration`] measures a standard. [`OpenRig`] opens the rig of a rig file, real or simulated.
//! The command line and the daemon both stand on this crate. It has no queue, no store and no network.

mod calibrate;
mod certificates;
mod directions;
mod error;
mod open_rig;
mod rig_port;
mod run;
mod run_hash;
mod run_request;
mod status;

pub use calibrate::{Calibrated, Calibration};
pub use certificates::Certificates;
pub use directions::job_text;
pub use error::{SessionError, is_disk_full};
pub use open_rig::{OpenRig, PortOfFile, RigSource};
pub use rig_port::RigPort;
pub use run::{Ended, extension_planner, prepare_output, resume, run, run_directory_name};
pub use run_request::{RunRequest, rig_file, rig_text, same_rig};
pub use status::Status;
