use std::collections::VecDeque;
use std::io::{self, PipeReader, PipeWriter};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rig::RigFile;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use super::line::{Line, Outgoing};
use super::link::Link;
use super::terminal::Terminal;
use super::{Counters, WireFaults, WireSettings, Written};
use crate::{Bench, Instrument, SimError};

/// Longest time until the mark of a killed client is cleared.
const HOUSEKEEPING: Duration = Duration::from_millis(100);

/// The simulator on a pseudo-terminal, served by a thread of its own until this is dropped.
///
/// Dropping it hangs up: a client gets an I/O error, as from an adapter that was unplugged.
pub struct Server {
    shared: Arc<Shared>,
    path: PathBuf,
    /// The stable name that was asked for, and the link while it is there.
    link: Option<(PathBuf, Option<Link>)>,
    cable: Option<Cable>,
}

pub(crate) struct Shared {
    line: Mutex<Line>,
    opened: Instant,
}

impl Shared {
    /// A test that panics while it holds the line does not take the simulator down.
    pub(crate) fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The bench, its time being now.
    pub(crate) fn bench<R>(&self, look: impl FnOnce(&mut Bench) -> R) -> R {
        let now = self.opened.elapsed();
        look(self.line().bench(now))
    }
}

/// The thread that serves one terminal; dropping this ends both.
struct Cable {
    /// Its end tells the thread to stop.
    stop: Option<PipeWriter>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Cable {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            // Its panic was reported by the panic hook; there is nothing left to do for it here.
            let _ = thread.join();
        }
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
    pub fn with_bench(bench: Bench, settings: &WireSettings) -> Result<Self, SimError> {
        let shared = Shared {
            line: Mutex::new(Line::new(bench, settings)),
            opened: Instant::now(),
        };
        let mut server = Self {
            shared: Arc::new(shared),
            path: PathBuf::new(),
            link: None,
            cable: None,
        };
        server.plug_in()?;
        Ok(server)
    }

    /// Pulls the adapter's plug: a client gets an I/O error. The bench goes on.
    pub fn unplug(&mut self) {
        self.cable = None;
        if let Some((_, link)) = &mut self.link {
            *link = None;
        }
    }

    /// Puts the plug in again, which may give the terminal another name; the stable one leads to it. Does nothing where
    /// it is in.
    ///
    /// # Errors
    /// [`SimError::Terminal`], [`SimError::Link`].
    pub fn plug_in(&mut self) -> Result<(), SimError> {
        if self.cable.is_some() {
            return Ok(());
        }
        let failed = |attempt| move |source| SimError::Terminal { attempt, source };
        let baud = self.bench(|bench| bench.devices()[0].baud());
        let terminal = Terminal::open(baud).map_err(failed("open a pseudo-terminal"))?;
        self.path = terminal.path().to_owned();
        let (stopped, stop) = io::pipe().map_err(failed("make a pipe"))?;
        let served = Arc::clone(&self.shared);
        let thread = std::thread::Builder::new()
            .name("firmware-sim".to_owned())
            .spawn(move || {
                if let Err(error) = serve(&terminal, &served, &stopped) {
                    tracing::error!(%error, "the simulated bus is gone");
                }
            })
            .map_err(failed("start a thread"))?;
        self.cable = Some(Cable {
            stop: Some(stop),
            thread: Some(thread),
        });
        if let Some((path, link)) = &mut self.link {
            *link = Some(Link::make(path, &self.path)?);
        }
        Ok(())
    }

    /// Gives the terminal a stable name as well: a symbolic link, replaced where a killed simulator left one, and
    /// removed when the server is dropped.
    ///
    /// # Errors
    /// [`SimError::Link`].
    pub fn link(&mut self, path: &Path) -> Result<(), SimError> {
        self.link = Some((path.to_owned(), Some(Link::make(path, &self.path)?)));
        Ok(())
    }

    /// What a client opens: the terminal of now, or the last one while the plug is out.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Serves an instrument that looks at the same light, on a TCP port, until what is returned is dropped.
    ///
    /// # Errors
    /// [`SimError::Instrument`].
    pub fn instrument(&self, rig: &RigFile, address: &str) -> Result<Instrument, SimError> {
        Instrument::serve(Arc::clone(&self.shared), rig, address)
    }

    /// Looks at the bench, or meddles with it, between two packets; its time is now.
    pub fn bench<R>(&self, look: impl FnOnce(&mut Bench) -> R) -> R {
        self.shared.bench(look)
    }

    /// Changes what goes wrong on the wire from now on.
    pub fn faults(&self, change: impl FnOnce(&mut WireFaults)) {
        change(self.shared.line().faults());
    }

    /// Has what goes wrong on the wire change at a time of the bench.
    pub fn schedule(&self, at: Duration, faults: WireFaults) {
        self.shared.line().schedule(at, faults);
    }

    /// All that the host writes from now on, as it arrives; an earlier trace ends. What is not taken out is kept.
    pub fn trace(&self) -> Receiver<Written> {
        let (listener, trace) = channel();
        self.shared.line().trace(listener);
        trace
    }

    /// When the line was opened, from which [`Written::received`] counts.
    pub fn opened(&self) -> Instant {
        self.shared.opened
    }

    /// What passed over the wire so far.
    pub fn counters(&self) -> Counters {
        self.shared.line().counters()
    }
}

/// Serves one terminal until the other end of `stopped` is closed.
fn serve(terminal: &Terminal, shared: &Shared, stopped: &PipeReader) -> io::Result<()> {
    // Replies are due to the microsecond; the default slack of a sleeping thread is fifty. Without it they are late,
    // no worse.
    let _ = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1));
    let mut due: VecDeque<Outgoing> = VecDeque::new();
    let mut buffer = [0; 4096];
    // Until when a busy port takes nothing of what has come.
    let mut busy: Option<Duration> = None;
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
        let deaf = busy.map_or(Duration::ZERO, |until| until.saturating_sub(now));
        match await_bytes(terminal, stopped, wait, deaf)? {
            Wake::Stop => return Ok(()),
            Wake::Bytes => {
                if busy.take().is_none()
                    && let Some(pause) = shared.line().busy()
                {
                    busy = Some(now + pause);
                    continue;
                }
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

/// Waits for bytes for so long at most; for so long as it is `deaf` for the end alone.
fn await_bytes(
    terminal: &Terminal,
    stopped: &PipeReader,
    wait: Duration,
    deaf: Duration,
) -> io::Result<Wake> {
    let (wait, heeded) = match deaf.is_zero() {
        true => (wait, PollFlags::IN),
        false => (wait.min(deaf), PollFlags::empty()),
    };
    let wait = Timespec::try_from(wait).map_err(io::Error::other)?;
    let mut sources = [PollFd::new(terminal, heeded), PollFd::new(stopped, PollFlags::IN)];
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
