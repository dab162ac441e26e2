use capture::Command;
use tokio::signal::unix::{Signal, SignalKind, signal};

/// What each signal in turn asks of a capture, and how that is told: to finish the reading and hold, then to stop at once.
pub(crate) const STEPS: [(Command, &str); 2] = [
    (
        Command::Finish,
        "stopping after this reading; again for an emergency stop",
    ),
    (Command::Estop, "emergency stop"),
];

/// What asks for an end: Ctrl-C, `kill`, and a terminal that was closed.
pub(crate) struct Signals {
    interrupt: Signal,
    terminate: Signal,
    hang_up: Signal,
}

impl Signals {
    /// Listens from now on.
    pub(crate) fn listen() -> std::io::Result<Self> {
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            hang_up: signal(SignalKind::hangup())?,
        })
    }

    /// Waits for the next one.
    pub(crate) async fn next(&mut self) {
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
            _ = self.hang_up.recv() => {}
        }
    }
}
