use std::io;
use std::path::PathBuf;

/// Why a run directory could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A file of the run directory could not be written; nothing under its name was touched.
    #[error("cannot write {path}")]
    Write {
        /// Which one.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The journal cannot be read.
    #[error(transparent)]
    Journal(#[from] capture::JournalError),
    /// The journal does not begin with a header.
    #[error("{path} has no header, so no plan")]
    NoHeader {
        /// The journal.
        path: PathBuf,
    },
    /// The certificate of a standard is not what it may be.
    #[error("{file}: {why}")]
    Standard {
        /// The file.
        file: String,
        /// What was found and what is allowed.
        why: String,
    },
    /// The journal's calibration holds a value that no rig of its rig file can have.
    #[error("the calibration in the journal, which was damaged or edited: restore the journal from a copy")]
    Certificate(#[source] rig::RigError),
    /// The readings of a standard do not make a calibration.
    #[error("no calibration")]
    Calibration(#[source] rig::RigError),
    /// There is no BRDF of the run.
    #[error("there is no BRDF of this run: {why}")]
    NoModel {
        /// Why.
        why: String,
    },
    /// This version does not accept the run's job file.
    #[error("the job file in the journal")]
    Job(#[source] sweep::SweepError),
    /// This version does not accept the run's rig file.
    #[error("the rig file in the journal")]
    Rig(#[source] rig::RigError),
}

/// Whether an I/O error says that there is no room: no space, quota, or a file size limit.
pub fn is_full(error: &io::Error) -> bool {
    use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    matches!(error.kind(), StorageFull | QuotaExceeded | FileTooLarge)
}
