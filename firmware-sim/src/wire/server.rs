use std::collections::VecDeque;
use std::io::{self, PipeReader, PipeWriter};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rig::RigFile;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use super::line::{Line, Outgoing};
use super::link::Link;
use super::terminal::Terminal;
use super::{Counters, WireFaults, WireSettings};
use crate::{Bench, SimError};

/// Longest time until the mark of a killed client is cleared.
const HOUSEKEEPING: Duration = Duration::from_millis(100);

/// The simulator on a pseudo-terminal, served by a thread of its own until this is dropped.
///
/// Dropping it hangs up: a client gets an I/O error, as from an adapter that was unplugged.
pub struct Server {
    shared: Arc<Shared>,
    path: std::path::PathBuf,
    link: Option<Link>,
    /// Its end tells the thread to stop.
    stop: Option<PipeWriter>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    line: Mutex<Line>,
    opened: Instant,
}

impl Shared {
    /// A test that panics while it holds the line does not take the simulator down.
    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Server {
    /// Serves what a rig file and its `[sim]` table describe.
    ///
    /// # Errors
    /// As [`Bench::new`], [`WireSettings::new`] and [`Server::with_bench`].
    pub fn start(rig: &RigFile) -> Result<Self, SimError> {
        Self::with_bench(Bench::new(rig)?, &WireSettings::new(rig)?)
    }

    /// Opens a pseudo-terminal and serves the bench on it.
    ///
    /// # Errors
    /// [`SimError::Terminal`].
    pub fn with_bench(mut bench: Bench, settings: &WireSettings) -> Result<Self, SimError> {
        let failed = |attempt| move |source| SimError::Terminal { attempt, source };
        let baud = bench.devices().first().map_or(57_600, |device| device.baud());
        let terminal = Terminal::open(baud).map_err(failed("open a pseudo-terminal"))?;
        let path = terminal.path().to_owned();
        let (stopped, stop) = io::pipe().map_err(failed("make a pipe"))?;
        let shared = Arc::new(Shared {
            line: Mutex::new(Line::new(bench, settings)),
            opened: Instant::now(),
        });
        let served = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("firmware-sim".to_owned())
            .spawn(move || {
                if let Err(error) = serve(&terminal, &served, &stopped) {
                    tracing::error!(%error, "the simulated bus is gone");
                }
            })
            .map_err(failed("start a thread"))?;
        Ok(Self {
            shared,
            path,
            link: None,
            stop: Some(stop),
            thread: Some(thread),
        })
    }

    /// Gives the terminal a stable name as well: a symbolic link, replaced where a killed simulator left one, and
    /// removed when the server is dropped.
    ///
    /// # Errors
    /// [`SimError::Link`].
    pub fn link(&mut self, path: &Path) -> Result<(), SimError> {
        self.link = Some(Link::make(path, &self.path)?);
        Ok(())
    }

    /// What a client opens.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Looks at the bench, or meddles with it, between two packets; its time is now.
    pub fn bench<R>(&self, look: impl FnOnce(&mut Bench) -> R) -> R {
        let now = self.shared.opened.elapsed();
        look(self.shared.line().bench(now))
    }

    /// Changes what goes wrong on the wire from now on.
    pub fn faults(&self, change: impl FnOnce(&mut WireFaults)) {
        change(self.shared.line().faults());
    }

    /// What passed over the wire so far.
    pub fn counters(&self) -> Counters {
        self.shared.line().counters()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            // Its panic was reported by the panic hook; there is nothing left to do for it here.
            let _ = thread.join();
        }
    }
}

/// Serves one terminal until the other end of `stopped` is closed.
fn serve(terminal: &Terminal, shared: &Shared, stopped: &PipeReader) -> io::Result<()> {
    // Replies are due to the microsecond; the default slack of a sleeping thread is fifty. Without it they are late,
    // no worse.
    let _ = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1));
    let mut due: VecDeque<Outgoing> = VecDeque::new();
    let mut buffer = [0; 4096];
    loop {
        let now = shared.opened.elapsed();
        while due.front().is_some_and(|first| first.due <= now) {
            if let Some(first) = due.pop_front() {
                terminal.write(&first.bytes)?;
            }
        }
        let wait = due
            .front()
            .map_or(HOUSEKEEPING, |first| first.due.saturating_sub(now))
            .min(HOUSEKEEPING);
        match await_bytes(terminal, stopped, wait)? {
            Wake::Stop => return Ok(()),
            Wake::Bytes => {
                let read = terminal.read(&mut buffer)?;
                let heard = shared
                    .line()
                    .receive(&buffer[..read], terminal.baud()?, shared.opened.elapsed());
                for outgoing in heard {
                    let place = due.partition_point(|other| other.due <= outgoing.due);
                    due.insert(place, outgoing);
                }
            }
            Wake::Nothing => {}
        }
        terminal.clear_exclusive()?;
    }
}

enum Wake {
    Stop,
    Bytes,
    Nothing,
}

fn await_bytes(terminal: &Terminal, stopped: &PipeReader, wait: Duration) -> io::Result<Wake> {
    let wait = Timespec::try_from(wait).map_err(io::Error::other)?;
    let mut sources = [
        PollFd::new(terminal, PollFlags::IN),
        PollFd::new(stopped, PollFlags::IN),
    ];
    match poll(&mut sources, Some(&wait)) {
        Err(Errno::INTR) => Ok(Wake::Nothing),
        Err(error) => Err(error.into()),
        Ok(_) if !sources[1].revents().is_empty() => Ok(Wake::Stop),
        Ok(_) if sources[0].revents().is_empty() => Ok(Wake::Nothing),
        Ok(_) => Ok(Wake::Bytes),
    }
}

#[cfg(test)]
mod tests;
