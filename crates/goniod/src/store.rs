use std::path::PathBuf;

use async_trait::async_trait;
use capture::Record;

use crate::{FaultCode, FaultView, Job, JobId, RunQuery, RunView, VerdictView};

mod journal;
mod memory;
mod sqlite;

pub(crate) use journal::StoreJournal;
pub use memory::{Behaviour, Memory};
pub(crate) use sqlite::has_log;
pub use sqlite::{Sqlite, backup, restore};

/// Where everything is kept that must outlive the program: jobs, runs, their journals, and who asked what.
///
/// What a method has returned from is durable. One daemon writes at a time.
#[async_trait]
pub trait Store: Send + Sync + 'static {
    /// Bytes that the medium has room for; `None` where nobody knows.
    fn room(&self) -> Option<u64> {
        None
    }

    /// Counts another start of the daemon; the first is 1.
    ///
    /// # Errors
    /// The medium refused.
    async fn begin_life(&self, at: &str) -> Result<u64, StoreError>;

    /// Adds a job at the end of the queue and sets its place.
    ///
    /// # Errors
    /// The medium refused.
    async fn add_job(&self, job: &mut Job) -> Result<(), StoreError>;

    /// Keeps a job's state, why, run and time of change.
    ///
    /// # Errors
    /// The medium refused.
    async fn change_job(&self, job: &Job) -> Result<(), StoreError>;

    /// One job.
    ///
    /// # Errors
    /// The medium refused, or what it holds is not a job.
    async fn job(&self, id: JobId) -> Result<Option<Job>, StoreError>;

    /// Jobs that are not over, in the order of the queue.
    ///
    /// # Errors
    /// As [`Self::job`].
    async fn waiting_jobs(&self) -> Result<Vec<Job>, StoreError>;

    /// The latest so many jobs that are over, of those before a place where one is named, the latest first.
    ///
    /// # Errors
    /// As [`Self::job`].
    async fn jobs_over(&self, before: Option<u64>, most: u32) -> Result<Vec<Job>, StoreError>;

    /// Begins a run with the first record of its journal, ties its job to it, and sets its place.
    ///
    /// # Errors
    /// The medium refused.
    async fn begin_run(&self, run: &mut RunView, header: &Record) -> Result<(), StoreError>;

    /// Keeps what is said of a run: the name of its specimen and its record.
    ///
    /// # Errors
    /// The medium refused.
    async fn describe_run(&self, run: &RunView) -> Result<(), StoreError>;

    /// Puts a run away, or takes it back into the history.
    ///
    /// # Errors
    /// The medium refused.
    async fn archive_run(&self, run: &str, at: Option<&str>) -> Result<(), StoreError>;

    /// Forgets a run with its journal; its job stays and has no run.
    ///
    /// # Errors
    /// The medium refused.
    async fn delete_run(&self, run: &str) -> Result<(), StoreError>;

    /// Notes when a run's files were written, and what its checks said.
    ///
    /// # Errors
    /// The medium refused.
    async fn reported(&self, run: &str, at: &str, verdict: VerdictView) -> Result<(), StoreError>;

    /// The runs that somebody wants to see, newest first.
    ///
    /// # Errors
    /// The medium refused, or what it holds is not a run.
    async fn runs(&self, query: &RunQuery) -> Result<Vec<RunView>, StoreError>;

    /// One run.
    ///
    /// # Errors
    /// As [`Self::runs`].
    async fn run(&self, id: &str) -> Result<Option<RunView>, StoreError>;

    /// Adds a record to a run's journal at a place, from 0.
    ///
    /// # Errors
    /// The medium refused; the place is taken, or the reading is there already.
    async fn append(&self, run: &str, seq: u64, record: &Record) -> Result<(), StoreError>;

    /// A run's journal, oldest record first.
    ///
    /// # Errors
    /// The medium refused, or what it holds is no record.
    async fn records(&self, run: &str) -> Result<Vec<Record>, StoreError>;

    /// The latest fault that nobody has acknowledged, in a store of an earlier version: faults have a file of their own
    /// since.
    ///
    /// # Errors
    /// The medium refused, or what it holds is no fault.
    async fn latched(&self) -> Result<Option<FaultView>, StoreError>;

    /// Notes who asked what, and what came of it.
    ///
    /// # Errors
    /// The medium refused.
    async fn audit(&self, at: &str, who: &str, what: &str, outcome: &str) -> Result<(), StoreError>;

    /// Finishes what is under way and closes.
    async fn close(&self);
}

/// What goes wrong with the store.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// It cannot be opened or made.
    #[error("cannot open the store {}", .path.display())]
    Open {
        /// Where.
        path: PathBuf,
        /// Why.
        source: sqlx::Error,
    },
    /// It was made by a newer version, or cannot be brought up to date.
    #[error("cannot bring the store {} up to date", .path.display())]
    Migrate {
        /// Where.
        path: PathBuf,
        /// Why.
        source: sqlx::migrate::MigrateError,
    },
    /// It is damaged.
    #[error("the store {} is damaged: {why}; bring a backup back with `goniod restore`", .path.display())]
    Corrupt {
        /// Where.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A copy of it would replace something.
    #[error("{} exists already: name a new file for the backup", .path.display())]
    Exists {
        /// Where.
        path: PathBuf,
    },
    /// A copy of it cannot be written.
    #[error("cannot write the copy of the store {}", .path.display())]
    Copy {
        /// Where.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A query failed.
    #[error("cannot {what} in the store")]
    Query {
        /// What was attempted.
        what: &'static str,
        /// Why.
        source: sqlx::Error,
    },
    /// The medium refuses everything.
    #[error("cannot {what} in the store: it refuses everything")]
    Unavailable {
        /// What was attempted.
        what: &'static str,
    },
    /// It holds something that this version cannot read.
    #[error("the store holds a {what} that cannot be read: {why}")]
    Damaged {
        /// What should be there.
        what: &'static str,
        /// What is wrong with it.
        why: String,
    },
}

impl StoreError {
    /// SQLite's primary result code of an error, where it has one: an extended code has it in its low byte.
    pub(crate) fn primary_code(error: &sqlx::Error) -> Option<u32> {
        let code = error
            .as_database_error()
            .and_then(sqlx::error::DatabaseError::code)?;
        code.parse::<u32>().ok().map(|code| code & 0xFF)
    }

    /// The fault that it is (SQLite, "Result and Error Codes"; an extended code has its primary one in the low byte).
    pub(crate) fn code(&self) -> FaultCode {
        const BUSY: u32 = 5;
        const LOCKED: u32 = 6;
        const READONLY: u32 = 8;
        const IOERR: u32 = 10;
        const FULL: u32 = 13;
        let (Self::Open { source, .. } | Self::Query { source, .. }) = self else {
            return FaultCode::Store;
        };
        match Self::primary_code(source) {
            Some(FULL) => FaultCode::DiskFull,
            Some(BUSY | LOCKED) => FaultCode::StoreLocked,
            Some(READONLY) => FaultCode::ReadOnly,
            Some(IOERR) => FaultCode::DiskError,
            _ => FaultCode::Store,
        }
    }
}
