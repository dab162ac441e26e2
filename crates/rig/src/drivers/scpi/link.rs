use std::io;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use tokio::sync::oneshot;

use super::transport::Transport;
use crate::RigError;
use crate::file::DetectorSettings;

/// Times that a reading is tried whose connection was lost or whose answer did not come: the arms stand meanwhile, and the
/// light has not changed.
const TRIES: u32 = 2;
/// Entries of the error queue that are read at most, to empty it after a connection.
const QUEUE: usize = 32;
/// Longest that an instrument may take beside its integration before a reading is thrown away after a change of range.
const MOST_SETTLING: u32 = 1000;

/// What an instrument is to do.
#[derive(Clone, Debug)]
pub(super) enum Task {
    /// Say who it is.
    Identify,
    /// Take a command, and say whether it is wrong.
    Tell(String),
    /// One reading, once it is set up as `configure` says.
    Measure {
        configure: String,
        integration: Duration,
    },
}

/// What came of it.
pub(super) type Answer = Result<String, Failure>;

/// Why nothing came of it.
#[derive(Debug)]
pub(super) struct Failure {
    /// Whether the instrument answered, so that asking again will not help.
    answered: bool,
    what: String,
}

impl Failure {
    /// The error of the instrument at an address.
    pub(super) fn at(self, address: String) -> RigError {
        RigError::Instrument {
            address,
            answered: self.answered,
            what: self.what,
        }
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        let what = match error.kind() {
            io::ErrorKind::TimedOut => {
                "no answer in time: check its power, its cable, detector.address and detector.timeout_ms"
                    .to_owned()
            }
            io::ErrorKind::UnexpectedEof => "it closed the connection".to_owned(),
            _ => error.to_string(),
        };
        Self {
            answered: false,
            what,
        }
    }
}

/// The failure of a thread that is gone.
pub(super) fn ended() -> Failure {
    Failure {
        answered: false,
        what: "the thread of the detector has ended".to_owned(),
    }
}

/// Handle of the thread that speaks with one instrument, one task after the other. The thread ends with the handle.
#[derive(Debug)]
pub(super) struct Link {
    tasks: Sender<(Task, oneshot::Sender<Answer>)>,
}

impl Link {
    /// Starts the thread; connects to nothing yet.
    pub(super) fn start(settings: &DetectorSettings) -> Result<Self, RigError> {
        let (tasks, todo) = channel();
        let speaker = Speaker {
            settings: settings.clone(),
            transport: None,
            configured: None,
        };
        std::thread::Builder::new()
            .name("rig-detector".to_owned())
            .spawn(move || speaker.work(&todo))
            .map_err(|source| RigError::Thread { source })?;
        Ok(Self { tasks })
    }

    /// Sets a task off.
    pub(super) fn begin(&self, task: Task) -> oneshot::Receiver<Answer> {
        let (sender, answer) = oneshot::channel();
        // Where the thread is gone, the sender is dropped and the receiver says so.
        let _ = self.tasks.send((task, sender));
        answer
    }

    /// A task, to its end.
    pub(super) async fn ask(&self, task: Task) -> Result<Answer, oneshot::error::RecvError> {
        self.begin(task).await
    }
}

/// The thread's end of it.
struct Speaker {
    settings: DetectorSettings,
    transport: Option<Transport>,
    /// How the instrument is set up, where that is known.
    configured: Option<String>,
}

impl Speaker {
    fn work(mut self, todo: &Receiver<(Task, oneshot::Sender<Answer>)>) {
        while let Ok((task, caller)) = todo.recv() {
            let tries = match task {
                Task::Measure { .. } => TRIES,
                Task::Identify | Task::Tell(_) => 1,
            };
            let mut answer = self.attempt(&task);
            for _ in 1..tries {
                if answer.as_ref().err().is_none_or(|failure| failure.answered) {
                    break;
                }
                answer = self.attempt(&task);
            }
            // A caller that went away does not want to know.
            let _ = caller.send(answer);
        }
    }

    fn attempt(&mut self, task: &Task) -> Answer {
        let done = self.connect().and_then(|()| self.carry_out(task));
        if done.as_ref().is_err_and(|failure| !failure.answered) {
            // An answer that comes late must not be taken for that to a later question.
            self.transport = None;
            self.configured = None;
        }
        done
    }

    fn connect(&mut self) -> Result<(), Failure> {
        if self.transport.is_some() {
            return Ok(());
        }
        let DetectorSettings { address, baud, .. } = &self.settings;
        let transport = Transport::open(address, *baud).map_err(|error| Failure {
            answered: false,
            what: format!("cannot connect ({error}): check its power, its cable and detector.address"),
        })?;
        self.transport = Some(transport);
        let own = self.settings.setup.clone();
        let setup = self.settings.profile.setup.iter().map(|line| (*line).to_owned());
        let lines: Vec<String> = setup.chain((!own.is_empty()).then_some(own)).collect();
        for line in &lines {
            self.send(line)?;
        }
        // What others left in the queue is no fault of ours; what the set-up put there is the last one.
        self.complaint("its set-up")
    }

    fn carry_out(&mut self, task: &Task) -> Answer {
        let patience = self.settings.timeout;
        match task {
            Task::Identify => self.ask("*IDN?", patience),
            Task::Tell(line) => {
                self.send(line)?;
                self.complaint(line)?;
                Ok(String::new())
            }
            Task::Measure {
                configure,
                integration,
            } => {
                let read = self.settings.read.clone();
                let within = *integration + patience;
                if self.configured.as_ref() != Some(configure) {
                    if !configure.is_empty() {
                        self.send(configure)?;
                        self.complaint(configure)?;
                    }
                    // Its range has changed: what it reads until it has settled is thrown away.
                    let readings = self.settings.settle.as_secs_f64() / integration.as_secs_f64();
                    for _ in 0..(readings.ceil() as u32).min(MOST_SETTLING) {
                        self.ask(&read, within)?;
                    }
                    self.configured = Some(configure.clone());
                }
                self.ask(&read, within)
            }
        }
    }

    fn transport(&mut self) -> io::Result<&mut Transport> {
        self.transport
            .as_mut()
            .ok_or_else(|| io::ErrorKind::NotConnected.into())
    }

    fn send(&mut self, line: &str) -> Result<(), Failure> {
        Ok(self.transport()?.send(line)?)
    }

    fn ask(&mut self, line: &str, within: Duration) -> Answer {
        let transport = self.transport()?;
        transport.send(line)?;
        Ok(transport.receive(within)?)
    }

    /// Empties the error queue; the first entry is an error.
    fn complaint(&mut self, after: &str) -> Result<(), Failure> {
        let mut first = None;
        for _ in 0..QUEUE {
            let entry = self.ask("SYST:ERR?", self.settings.timeout)?;
            let number = entry.split(',').next().unwrap_or_default().trim();
            match number.parse::<i32>() {
                Ok(0) => break,
                Ok(_) => first = first.or(Some(entry)),
                Err(_) => {
                    return Err(Failure {
                        answered: false,
                        what: format!(
                            "it answered {entry:?} to SYST:ERR?, which is no entry of an error queue"
                        ),
                    });
                }
            }
        }
        match first {
            None => Ok(()),
            Some(entry) => Err(Failure {
                answered: true,
                what: format!("it refused {after:?}: {entry}"),
            }),
        }
    }
}
