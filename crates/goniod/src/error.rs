use std::io;
use std::path::PathBuf;

use rig::FaultKind;

use session::{SessionError, Status};

/// Why an order was not carried out. What a fault of the rig left behind is no error but a failed outcome.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DaemonError {
    /// A file of the order cannot be read.
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
    /// The store cannot be opened, read or written.
    #[error(transparent)]
    Store(#[from] crate::StoreError),
    /// Another daemon uses the data folder.
    #[error("the data folder {} is in use by another goniod", .path.display())]
    InUse {
        /// Which.
        path: PathBuf,
    },
    /// The rig file has changed since the run began in more than its port.
    #[error("the rig file is not the one with which run {run} began: only [bus] and [sim] may differ")]
    OtherRig {
        /// Which run.
        run: String,
    },
    /// A thread cannot be started.
    #[error("cannot start a thread for the rig")]
    Thread(#[source] io::Error),
    /// The planning of a job ended without a plan.
    #[error("the job could not be planned")]
    Planning(#[source] tokio::task::JoinError),
    /// The journal cannot be opened, or not written any more.
    #[error(transparent)]
    Journal(#[from] capture::JournalError),
    /// The capture could not begin, or its journal not go on.
    #[error(transparent)]
    Capture(#[from] capture::CaptureError),
    /// What follows from the journal could not be worked out or written.
    #[error(transparent)]
    Report(#[from] report::ReportError),
    /// A run was not carried out for a reason of its own.
    #[error(transparent)]
    Session(SessionError),
}

impl From<rig::RigError> for DaemonError {
    fn from(error: rig::RigError) -> Self {
        Self::Rig(Box::new(error))
    }
}

impl From<SessionError> for DaemonError {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::Read { what, path, source } => Self::Read { what, path, source },
            SessionError::Job(error) => Self::Job(error),
            SessionError::Rig(error) => Self::Rig(error),
            SessionError::Port { file, source } => Self::Port { file, source },
            SessionError::Sim { file, source } => Self::Sim { file, source },
            SessionError::Uncertified { directory, why } => Self::Uncertified { directory, why },
            SessionError::Out { path, source } => Self::Out { path, source },
            SessionError::NotReady { kind, source } => Self::NotReady { kind, source },
            SessionError::Journal(error) => Self::Journal(error),
            SessionError::Capture(error) => Self::Capture(error),
            SessionError::Report(error) => Self::Report(error),
            other => Self::Session(other),
        }
    }
}

impl DaemonError {
    /// The exit status that it leads to.
    pub fn status(&self) -> Status {
        if self.disk_full() {
            return Status::Stopped;
        }
        match self {
            Self::NotReady { kind: fault, .. } => kind(*fault),
            Self::Rig(error) | Self::Port { source: error, .. } => kind(rig::Fault::kind(error.as_ref())),
            Self::Job(sweep::SweepError::Start { .. })
            | Self::Capture(capture::CaptureError::OtherDevices { .. }) => Status::Rig,
            Self::Capture(capture::CaptureError::Journal(_)) => Status::Stopped,
            _ => Status::Invalid,
        }
    }

    /// Whether the medium is full: what was measured is safe and the run can be resumed.
    pub(crate) fn disk_full(&self) -> bool {
        let mut cause: Option<&(dyn std::error::Error + 'static)> = Some(self);
        while let Some(error) = cause {
            if error.downcast_ref::<io::Error>().is_some_and(report::is_full) {
                return true;
            }
            cause = error.source();
        }
        false
    }
}

fn kind(kind: FaultKind) -> Status {
    match kind {
        FaultKind::Setup => Status::Invalid,
        _ => Status::Rig,
    }
}
