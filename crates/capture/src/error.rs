use std::path::PathBuf;

use rig::Identity;

/// Why a journal could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JournalError {
    /// The medium refused.
    #[error("cannot {what} the journal {path}")]
    Io {
        /// What was attempted.
        what: &'static str,
        /// Where.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The store that keeps the journal refused.
    #[error("cannot keep the journal of run {run}")]
    Store {
        /// Which run.
        run: String,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Another process writes this journal.
    #[error("the journal {path} is in use by another process")]
    Locked {
        /// Where.
        path: PathBuf,
    },
    /// What is there is no journal, or one that is damaged before its end.
    #[error("journal {path}, line {line}: {why}")]
    Damaged {
        /// Where.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What was found.
        why: String,
    },
}

/// Why a plan could not be run, or not further.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// The journal does not begin with a header.
    #[error("the journal has no header, so no plan")]
    NoHeader,
    /// A run is to go on with other devices than it began with. Nothing moved.
    #[error("the run began with {}, now there are {}", list(.recorded), list(.found))]
    OtherDevices {
        /// Who answered when it began.
        recorded: Vec<Identity>,
        /// Who answers now.
        found: Vec<Identity>,
    },
    /// The journal cannot be written any more. What it holds is sound, and the run can be resumed.
    #[error("readings can no longer be recorded")]
    Journal(#[from] JournalError),
}

fn list(identities: &[Identity]) -> String {
    let names = identities.iter().map(|identity| {
        format!(
            "{} (id {}, firmware {})",
            identity.model, identity.id, identity.firmware
        )
    });
    names.collect::<Vec<_>>().join(", ")
}
