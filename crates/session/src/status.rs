use capture::Outcome;

/// How a command ended; its code is the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    /// Everything was done.
    Done = 0,
    /// An error is above the bound that was given: a gate is closed.
    Above = 1,
    /// Bad arguments, config or file; nothing was touched.
    Invalid = 2,
    /// Rig fault or missing device.
    Rig = 3,
    /// Stopped before the end, or the disk is full: can be resumed.
    Stopped = 4,
    /// The daemon cannot be reached, or refuses.
    Daemon = 5,
    /// Everything was measured, but the result must not be used: there is no reconstruction, or a check is bad.
    Unusable = 6,
}

impl Status {
    /// The exit code.
    pub const fn code(self) -> u8 {
        self as u8
    }
}

impl From<&Outcome> for Status {
    fn from(outcome: &Outcome) -> Self {
        match outcome {
            Outcome::Done => Self::Done,
            Outcome::Stopped => Self::Stopped,
            Outcome::Failed { .. } => Self::Rig,
        }
    }
}
