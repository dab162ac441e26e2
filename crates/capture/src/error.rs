use std::path::PathBuf;

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
