use std::io;
use std::path::PathBuf;

use rig::FaultKind;

use crate::Status;

/// Why a run or a calibration was not carried out. What a fault of the rig left behind is no error but a failed outcome.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// A job, rig or calibration file cannot be read.
    #[error("cannot read the {what} {}", .path.display())]
    Read {
        /// Which kind of file.
        what: &'static str,
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The job file is wrong, or this rig cannot do it.
    #[error(transparent)]
    Job(#[from] sweep::SweepError),
    /// The rig file is wrong.
    #[error(transparent)]
    Rig(Box<rig::RigError>),
    /// The port that the rig file names cannot be used.
    #[error("{file}: bus.port")]
    Port {
        /// The rig file.
        file: String,
        /// Why not.
        source: Box<rig::RigError>,
    },
    /// The `[sim]` table of the rig file is wrong.
    #[error("{file}")]
    Sim {
        /// The rig file.
        file: String,
        /// What is wrong in it.
        source: firmware_sim::SimError,
    },
    /// The rig file asks for a stored calibration, and there is no valid one.
    #[error("no valid calibration in {}: {why}", .directory.display())]
    Uncertified {
        /// Where they are looked for.
        directory: PathBuf,
        /// What is missing.
        why: String,
    },
    /// The file of a stored calibration is damaged, was edited, or says what no rig of the rig file can have.
    #[error(
        "the calibration {}: {why}. Restore the file from a copy, or move it out of its directory and calibrate anew with `gonioctl calibrate`",
        .path.display()
    )]
    Certificate {
        /// Its file.
        path: PathBuf,
        /// The key, what was found and what is allowed, where a value is wrong.
        why: String,
    },
    /// This computer's clock cannot be right, and what is made now would be dated wrongly.
    #[error("nothing is calibrated: {why}")]
    Clock {
        /// What it says, what speaks against it, and what to do.
        why: String,
    },
    /// Run directories cannot be made there.
    #[error("cannot make run directories in {}", .path.display())]
    Out {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The devices are not all there, or not what the rig file says; nothing moved.
    #[error("the rig is not ready")]
    NotReady {
        /// Kind of the fault.
        kind: FaultKind,
        /// What failed.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The rig file has changed since the run began in more than its port.
    #[error("the rig file is not the one with which run {run} began: only [bus] and [sim] may differ")]
    OtherRig {
        /// Which run.
        run: String,
    },
    /// The journal cannot be opened, or not written any more.
    #[error(transparent)]
    Journal(#[from] capture::JournalError),
    /// The capture could not begin, or its journal not go on.
    #[error(transparent)]
    Capture(#[from] capture::CaptureError),
    /// What follows from the journal could not be worked out or written.
    #[error(transparent)]
    Report(#[from] report::ReportError),
}

impl From<rig::RigError> for SessionError {
    fn from(error: rig::RigError) -> Self {
        Self::Rig(Box::new(error))
    }
}

impl SessionError {
    /// The exit status that it leads to.
    pub fn status(&self) -> Status {
        if is_disk_full(self) {
            return Status::Stopped;
        }
        match self {
            Self::NotReady { kind: fault, .. } => kind(*fault),
            Self::Rig(error) => kind(rig::Fault::kind(error.as_ref())),
            // The rig file is sound; what it names is absent, in use, not permitted or not a serial port. `doctor` says
            // the same of each.
            Self::Port { .. } => Status::Rig,
            Self::Job(sweep::SweepError::Start { .. })
            | Self::Capture(capture::CaptureError::OtherDevices { .. }) => Status::Rig,
            Self::Capture(capture::CaptureError::Journal(_)) => Status::Stopped,
            _ => Status::Invalid,
        }
    }
}

/// Whether an error comes of a medium that is full: what was measured is safe and the run can be resumed.
pub fn is_disk_full(error: &(dyn std::error::Error + 'static)) -> bool {
    let causes = std::iter::successors(Some(error), |error| error.source());
    causes
        .filter_map(|cause| cause.downcast_ref::<io::Error>())
        .any(report::is_full)
}

fn kind(kind: FaultKind) -> Status {
    match kind {
        FaultKind::Setup => Status::Invalid,
        _ => Status::Rig,
    }
}
