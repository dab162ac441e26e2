use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

use capture::Command;
use tokio::sync::watch;

use crate::event::Log;
use crate::remedy::remedy;
use crate::{Caller, FaultCode, FaultId, FaultView, Refusal, RigView, What};

mod permit;
mod record;

pub(crate) use permit::{Permit, Purpose, Receipt};
pub(crate) use record::OperatorRecord;
use record::RecordFile;

/// Longest time that the answer to a stop waits for the rig to have carried it out, where a device gives no reply.
const CARRIED_OUT: Duration = Duration::from_secs(2);

/// Owns what the operator said last, and everything that waits for it.
///
/// It is the only place that lets a motion begin: whoever wants one needs a [`Permit`], and gets it only for a request
/// that came in after the latest stop, while no fault is latched. A stop or an emergency stop reaches the motion under
/// way at once, through no queue and no store, and is answered when it is on disk and that motion can write no further
/// goal but the one that halts the arms.
pub(crate) struct OperatorControl {
    state: Mutex<State>,
    /// What the rig's worker and the queue must hear of.
    signal: watch::Sender<Signal>,
    file: RecordFile,
    view: watch::Sender<RigView>,
    log: Arc<Log>,
    clock: fn() -> SystemTime,
}

/// How often the operator stopped the rig, for whoever has to react.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Signal {
    /// Stops and emergency stops so far that the worker has to carry out.
    pub(crate) stops: u64,
    /// Emergency stops so far.
    pub(crate) emergency_stops: u64,
    /// Whether a motion is under way that may still write a goal.
    pub(crate) may_move: bool,
    /// What was asked of the motion under way; [`Command::Run`] where there is none.
    pub(crate) command: Command,
    /// Whether the daemon is to end.
    pub(crate) closing: bool,
}

struct State {
    /// What must survive the program.
    record: OperatorRecord,
    /// Stops and emergency stops so far; a request that came in before the latest moves nothing.
    presses: u64,
    /// Whether the worker was told of a stop, and nothing has been let move since.
    stopped: bool,
    /// Stops that are not answered yet: whatever is received meanwhile moves nothing.
    unanswered: usize,
    /// The motion under way.
    motion: Option<Motion>,
    closing: bool,
}

struct Motion {
    command: watch::Sender<Command>,
    /// Whether it can write no goal any more.
    released: bool,
}

/// A stop that cannot be lost any more while the program runs, but is not on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NotKept(pub(crate) String);

impl OperatorControl {
    /// The control as it was left: faults that nobody acknowledged are still latched, a stop still holds the queue.
    pub(crate) fn open(
        directory: &std::path::Path,
        earlier: impl FnOnce() -> Option<FaultView>,
        view: watch::Sender<RigView>,
        log: Arc<Log>,
        clock: fn() -> SystemTime,
    ) -> Arc<Self> {
        let (file, record) = RecordFile::open(directory);
        let record = record.unwrap_or_else(|unusable| OperatorRecord {
            queue_held: false,
            faults: match unusable {
                // A data folder of an earlier version has its faults in the store alone.
                None => earlier().into_iter().collect(),
                // Nobody knows what was latched: it is for the operator to say that the rig may move.
                Some(why) => vec![fault(FaultCode::Store, why, None, clock())],
            },
        });
        let control = Arc::new(Self {
            state: Mutex::new(State {
                record,
                presses: 0,
                stopped: false,
                unanswered: 0,
                motion: None,
                closing: false,
            }),
            signal: watch::Sender::default(),
            file,
            view,
            log,
            clock,
        });
        control.show(&control.state());
        control
    }

    /// Follows what the operator does.
    pub(crate) fn subscribe(&self) -> watch::Receiver<Signal> {
        self.signal.subscribe()
    }

    /// Notes that a request has come in. To be called before anything is waited for.
    pub(crate) fn receive(&self) -> Receipt {
        let state = self.state();
        Receipt::new(state.presses, state.unanswered > 0)
    }

    /// Lets a motion begin that was asked for by a request. What a stop holds goes on where an operator starts a job.
    ///
    /// # Errors
    /// A fault is latched; a stop came after the request; a stop holds the queue and the request does not end that; a
    /// motion is under way; the daemon is shutting down.
    pub(crate) fn permit(self: &Arc<Self>, receipt: Receipt, purpose: Purpose) -> Result<Permit, Refusal> {
        let mut state = self.state();
        if let Some(fault) = state.record.faults.last() {
            return Err(Refusal::conflict(format!(
                "a fault is latched ({}): look at the rig, then acknowledge fault {}",
                fault.text, fault.id
            )));
        }
        if state.closing {
            return Err(Refusal::unavailable("the daemon is shutting down"));
        }
        if state.unanswered > 0 || !receipt.is_after(state.presses) {
            return Err(Refusal::conflict(
                "the rig was stopped after this was asked for; ask again",
            ));
        }
        if state.motion.is_some() {
            return Err(Refusal::conflict(
                "the rig is busy or still coming to rest; try again",
            ));
        }
        if state.record.queue_held && purpose == Purpose::Submission {
            return Err(Refusal::conflict("a stop holds the queue"));
        }
        let lifted = state.record.queue_held && purpose == Purpose::Start;
        if lifted {
            state.record.queue_held = false;
        }
        let command = watch::Sender::new(Command::Run);
        let receiver = command.subscribe();
        state.stopped = false;
        state.motion = Some(Motion {
            command,
            released: false,
        });
        self.publish(&state);
        if lifted {
            self.file.keep(&state.record);
            self.show(&state);
        }
        Ok(Permit::new(self.clone(), receiver))
    }

    /// Stops the rig and holds the queue until an operator starts a job. Never refused; returns when it cannot be lost
    /// any more and the arms are told nothing but to stop.
    ///
    /// # Errors
    /// It holds, but cannot be written to disk: it is forgotten when the program ends.
    pub(crate) async fn stop(self: &Arc<Self>, command: Command) -> Result<(), NotKept> {
        let answer = self.press(command, |state| state.record.queue_held = true);
        answer.wait().await
    }

    /// Stops the arms at once and latches a fault with a new id. Never refused.
    ///
    /// # Errors
    /// As [`Self::stop`].
    pub(crate) async fn emergency_stop(self: &Arc<Self>, by: &Caller) -> Result<FaultId, NotKept> {
        let text = format!("emergency stop by {}", by.name);
        let run = self.view.borrow().run.clone();
        let pressed = fault(FaultCode::Estop, text, run, (self.clock)());
        let id = pressed.id.clone();
        let answer = self.press(Command::Estop, |state| state.latch(pressed.clone()));
        tracing::error!(fault = %id, "{}", pressed.text);
        self.log
            .publish(pressed.at.clone(), What::Fault { fault: pressed });
        answer.wait().await.map(|()| id)
    }

    /// Latches a fault that ended a motion.
    pub(crate) fn latch(&self, code: FaultCode, text: String) {
        let run = self.view.borrow().run.clone();
        let latched = fault(code, text, run, (self.clock)());
        tracing::error!(?code, fault = %latched.id, "fault: {}", latched.text);
        let mut state = self.state();
        state.latch(latched.clone());
        self.file.keep(&state.record);
        self.show(&state);
        drop(state);
        self.log
            .publish(latched.at.clone(), What::Fault { fault: latched });
    }

    /// Ends the fault of this id, where it is the newest; starts nothing. An earlier one that is still latched is shown
    /// after it.
    ///
    /// # Errors
    /// No fault is latched; another one is newer; the rig is still coming to rest.
    pub(crate) async fn acknowledge(&self, by: &Caller, id: &FaultId) -> Result<FaultView, Refusal> {
        let acknowledged = {
            let mut state = self.state();
            let Some(newest) = state.record.faults.last().cloned() else {
                return Err(Refusal::conflict("no fault is latched"));
            };
            if newest.id != *id {
                return Err(Refusal::newer_fault(id, newest));
            }
            if state.unanswered > 0 || state.motion.is_some() {
                return Err(Refusal::conflict("the rig is still coming to rest; try again"));
            }
            state.record.faults.pop();
            self.file.keep(&state.record);
            self.show(&state);
            newest
        };
        self.log.publish(
            self.now(),
            What::Acknowledged {
                by: by.name.clone(),
                id: acknowledged.id.clone(),
            },
        );
        if let Err(NotKept(why)) = self.file.kept().await {
            tracing::warn!("the fault is latched again after a restart: {why}");
        }
        Ok(acknowledged)
    }

    /// Has the capture hold after its reading.
    ///
    /// # Errors
    /// Nothing is under way, or it is being stopped.
    pub(crate) fn pause(&self) -> Result<(), Refusal> {
        let state = self.state();
        let motion = state.motion.as_ref().filter(|motion| !motion.released);
        let motion = motion.ok_or_else(|| Refusal::conflict("nothing is under way that could pause"))?;
        let paused = motion.escalate(Command::Pause);
        self.publish(&state);
        match paused {
            Command::Pause => Ok(()),
            other => Err(Refusal::conflict(format!(
                "cannot pause: {} was asked for",
                word(other)
            ))),
        }
    }

    /// Has a paused capture go on.
    ///
    /// # Errors
    /// Nothing is paused.
    pub(crate) fn proceed(&self) -> Result<(), Refusal> {
        let state = self.state();
        let paused = state.motion.as_ref().is_some_and(|motion| {
            motion.command.send_if_modified(|command| {
                let paused = *command == Command::Pause;
                if paused {
                    *command = Command::Run;
                }
                paused
            })
        });
        self.publish(&state);
        match paused {
            true => Ok(()),
            false => Err(Refusal::conflict("nothing is paused")),
        }
    }

    /// Has the daemon end: the reading is finished, then nothing begins any more.
    pub(crate) fn close(&self) {
        let mut state = self.state();
        state.closing = true;
        if let Some(motion) = &state.motion {
            motion.escalate(Command::Finish);
        }
        self.publish(&state);
    }

    /// Waits until what was said last is on disk.
    ///
    /// # Errors
    /// It cannot be written.
    pub(crate) async fn kept(&self) -> Result<(), NotKept> {
        self.file.kept().await
    }

    /// Wall clock, RFC 3339, UTC.
    fn now(&self) -> String {
        humantime::format_rfc3339_millis((self.clock)()).to_string()
    }

    /// Carries a stop to whatever moves and counts it.
    fn press(self: &Arc<Self>, command: Command, change: impl FnOnce(&mut State)) -> Answer {
        let mut state = self.state();
        state.unanswered += 1;
        if let Some(motion) = &state.motion {
            motion.escalate(command);
        }
        change(&mut state);
        state.presses += 1;
        // A stop of what stands still since the last one changes nothing: however often it is pressed, nobody is woken.
        let news = command == Command::Estop || !state.stopped || state.motion.is_some();
        state.stopped = true;
        self.file.keep(&state.record);
        if news {
            self.signal.send_modify(|signal| {
                signal.stops += 1;
                signal.emergency_stops += u64::from(command == Command::Estop);
                signal.command = state.command();
            });
        }
        self.show(&state);
        Answer {
            control: self.clone(),
        }
    }

    /// Lets the worker and the queue know how things stand.
    fn publish(&self, state: &State) {
        self.signal.send_modify(|signal| {
            signal.command = state.command();
            signal.may_move = state.may_move();
            signal.closing = state.closing;
        });
    }

    /// Shows the newest fault and what holds the queue.
    fn show(&self, state: &State) {
        self.view.send_if_modified(|view| {
            let fault = state.record.faults.last().cloned();
            let held = state.holds();
            let changed = view.fault != fault || view.queue_held != held;
            (view.fault, view.queue_held) = (fault, held);
            changed
        });
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The motion under way writes no goal any more.
    fn release(&self, over: bool) {
        let mut state = self.state();
        let Some(motion) = &mut state.motion else { return };
        motion.released = true;
        let command = *motion.command.borrow();
        if over {
            state.motion = None;
        }
        // Whoever paused what then came to its end did not want the next job to start.
        if over && command == Command::Pause {
            state.record.queue_held = true;
            self.file.keep(&state.record);
        }
        self.publish(&state);
        self.show(&state);
    }
}

impl State {
    fn command(&self) -> Command {
        self.motion
            .as_ref()
            .map_or(Command::Run, |motion| *motion.command.borrow())
    }

    fn may_move(&self) -> bool {
        self.motion.as_ref().is_some_and(|motion| !motion.released)
    }

    fn holds(&self) -> Option<String> {
        if let Some(fault) = self.record.faults.last() {
            return Some(format!("a fault is latched: {}", fault.text));
        }
        self.record
            .queue_held
            .then(|| "the rig was stopped: start or resume a job to go on".to_owned())
    }

    /// Adds a fault as the newest. A second emergency stop takes the place of the first: whoever saw only that one has
    /// not seen the rig since.
    fn latch(&mut self, fault: FaultView) {
        self.record.faults.retain(|known| known.code != fault.code);
        self.record.faults.push(fault);
    }
}

impl Motion {
    /// Asks for something, unless more was asked for already; returns what is asked for now.
    fn escalate(&self, command: Command) -> Command {
        self.command.send_if_modified(|now| {
            let more = severity(command) > severity(*now);
            if more {
                *now = command;
            }
            more
        });
        *self.command.borrow()
    }
}

/// The answer to a stop: due once it is on disk, and once the motion that was under way writes no goal any more.
struct Answer {
    control: Arc<OperatorControl>,
}

impl Answer {
    async fn wait(self) -> Result<(), NotKept> {
        let mut signal = self.control.subscribe();
        // No motion begins before this is answered.
        let carried_out = signal.wait_for(|signal| !signal.may_move);
        // A rig that does not answer is no reason to leave the operator without an answer.
        let _ = tokio::time::timeout(CARRIED_OUT, carried_out).await;
        self.control.kept().await
    }
}

impl Drop for Answer {
    fn drop(&mut self) {
        self.control.state().unanswered -= 1;
    }
}

const fn severity(command: Command) -> u8 {
    match command {
        Command::Run => 0,
        Command::Pause => 1,
        Command::Finish => 2,
        Command::Stop => 3,
        Command::Estop => 4,
    }
}

fn word(command: Command) -> &'static str {
    match command {
        Command::Run => "going on",
        Command::Pause => "a pause",
        Command::Finish => "the end of the run",
        Command::Stop => "a stop",
        Command::Estop => "an emergency stop",
    }
}

fn fault(code: FaultCode, text: String, run: Option<String>, at: SystemTime) -> FaultView {
    FaultView {
        id: FaultId::generate(),
        code,
        remedy: Some(remedy(code, &text)),
        text,
        at: humantime::format_rfc3339_millis(at).to_string(),
        run,
    }
}
