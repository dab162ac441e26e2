use session::Status;

/// Why a command that asks a daemon cannot do what it is to do, though the daemon answers.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CommandError {
    /// There is nothing to do it with.
    #[error("{0}")]
    Absent(&'static str),
    /// It could not begin now.
    #[error("the daemon cannot run this now: {0}")]
    Busy(String),
    /// A job ended before it had a run, or the daemon's program could not do what it was asked.
    #[error("{why}")]
    Unbegun {
        /// What kept it from beginning.
        why: String,
        /// How the command ends.
        status: Status,
    },
}

impl CommandError {
    /// The exit status that it leads to.
    pub(crate) fn status(&self) -> Status {
        match self {
            Self::Absent(_) | Self::Busy(_) => Status::Daemon,
            Self::Unbegun { status, .. } => *status,
        }
    }
}
