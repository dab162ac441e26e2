use std::sync::Arc;

use capture::Command;
use tokio::sync::watch;

use super::OperatorControl;

/// When a request came in, told by the stops before it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Receipt {
    stops: u64,
    /// Whether a stop was not answered yet: then it did not come in after that stop.
    during_stop: bool,
}

impl Receipt {
    pub(super) fn new(stops: u64, during_stop: bool) -> Self {
        Self { stops, during_stop }
    }

    /// Whether the request came in after the answer to the latest of so many stops.
    pub(super) fn is_after(self, stops: u64) -> bool {
        !self.during_stop && self.stops == stops
    }
}

/// What a motion is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// An operator starts or resumes a job: a queue that a stop holds goes on.
    Start,
    /// A job is submitted whose specimen lies on the stage: it starts only where nothing holds the queue.
    Submission,
    /// An operator moves an arm: it moves, and the queue stays as it is.
    Jog,
}

/// Leave for one motion, or for one run, as long as it lasts.
///
/// The only way to have an arm moved. It cannot be had twice, nor kept for later: whoever drops it has to ask anew.
#[derive(Debug)]
pub(crate) struct Permit {
    control: Arc<OperatorControl>,
    command: watch::Receiver<Command>,
}

impl Permit {
    pub(super) fn new(control: Arc<OperatorControl>, command: watch::Receiver<Command>) -> Self {
        Self { control, command }
    }

    /// What the operator asks of this motion and of no other.
    pub(crate) fn command(&self) -> watch::Receiver<Command> {
        self.command.clone()
    }

    /// What is asked for now.
    pub(crate) fn now(&self) -> Command {
        *self.command.borrow()
    }

    /// Says that no goal will be written any more: the arms hold, or were told to stop.
    pub(crate) fn release(&self) {
        self.control.release(false);
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        self.control.release(true);
    }
}

impl std::fmt::Debug for OperatorControl {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OperatorControl").finish_non_exhaustive()
    }
}
