use std::io;
use std::path::PathBuf;

use session::{SessionError, Status, is_disk_full};

/// Why the daemon could not be opened, or did not carry a job out. What a fault of the rig left behind is no error but a
/// failed outcome.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DaemonError {
    /// A run could not be prepared, carried out or reported, whoever asks for it.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The store cannot be opened, read or written.
    #[error(transparent)]
    Store(#[from] crate::StoreError),
    /// Run directories lie beside a store that does not know them.
    #[error(
        "the store {} {how} {count} of the runs in {}, such as {such_as}: it was emptied, deleted or replaced. Bring it \
         back with `goniod restore BACKUP --data DIR`; or, where these runs belong to no store, start once with \
         --accept-runs",
        .store.display(), .runs.display()
    )]
    StrangeRuns {
        /// The store.
        store: PathBuf,
        /// What of the store shows that.
        how: &'static str,
        /// Where the run directories are.
        runs: PathBuf,
        /// How many it does not know.
        count: usize,
        /// One of them.
        such_as: String,
    },
    /// Another daemon uses the data folder.
    #[error("the data folder {} is in use by another goniod", .path.display())]
    InUse {
        /// Which.
        path: PathBuf,
    },
    /// A thread cannot be started.
    #[error("cannot start a thread for the rig")]
    Thread(#[source] io::Error),
    /// The planning of a job ended without a plan.
    #[error("the job could not be planned")]
    Planning(#[source] tokio::task::JoinError),
}

impl From<rig::RigError> for DaemonError {
    fn from(error: rig::RigError) -> Self {
        Self::Session(error.into())
    }
}

impl From<capture::CaptureError> for DaemonError {
    fn from(error: capture::CaptureError) -> Self {
        Self::Session(error.into())
    }
}

impl From<report::ReportError> for DaemonError {
    fn from(error: report::ReportError) -> Self {
        Self::Session(error.into())
    }
}

impl DaemonError {
    /// The exit status that it leads to.
    pub fn status(&self) -> Status {
        match self {
            Self::Session(error) => error.status(),
            error if is_disk_full(error) => Status::Stopped,
            _ => Status::Invalid,
        }
    }
}
