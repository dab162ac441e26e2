use std::sync::Arc;
use std::time::Duration;

use arms::{Arm, ArmAngle};
use capture::Command;
use rig::{DriveError, Fault, FaultKind};
use session::SessionError;
use tokio::sync::{mpsc, watch};

use crate::daemon::Reply;
use crate::operator::{Permit, Signal};
use crate::queue::WorkerEvent;
use crate::refusal::chain;
use crate::shared::Shared;
use crate::{Activity, DaemonError, FaultCode, Job, OpenRig, RigSource};

mod jog;
mod observer;
mod run_job;

/// Time between two looks at a rig that has nothing to do.
const LOOK: Duration = Duration::from_secs(1);

/// Where a worker runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkerPlace {
    /// On a thread of its own: whatever else the program is busy with does not keep a capture waiting.
    Thread,
    /// In a task of the present runtime, whose clock may be paused.
    Task,
}

/// What the worker is to do.
pub(crate) enum Task {
    /// Run a job, or go on with it.
    RunJob { job: Box<Job>, permit: Permit },
    /// Move one arm, or both to rest; answers once the motion was checked.
    Move {
        to: Option<(Arm, ArmAngle)>,
        permit: Permit,
        reply: Reply<()>,
    },
    /// Release the rig and end.
    Close,
}

/// Owns the rig. It does one task at a time, and stops the arms whenever the operator says so, whatever else it waits
/// for.
pub(crate) struct RigWorker<S: RigSource> {
    shared: Arc<Shared>,
    source: S,
    events: mpsc::Sender<WorkerEvent>,
    /// What the operator does.
    signal: watch::Receiver<Signal>,
    /// What of that was carried out last.
    applied: Signal,
    /// The rig, while it can be reached.
    rig: Option<OpenRig<S::Rig>>,
}

impl<S: RigSource> RigWorker<S> {
    /// Opens the rig where it can be, and starts to work.
    ///
    /// # Errors
    /// Another program has the port; the `[sim]` table is wrong; there is no thread to be had.
    pub(crate) fn start(
        shared: Arc<Shared>,
        source: S,
        place: WorkerPlace,
        events: mpsc::Sender<WorkerEvent>,
    ) -> Result<mpsc::Sender<Task>, DaemonError> {
        let signal = shared.operator.subscribe();
        let applied = *signal.borrow();
        let mut worker = Self {
            applied,
            signal,
            shared,
            source,
            events,
            rig: None,
        };
        let opened = worker
            .source
            .open(&worker.shared.rig, &worker.shared.settings.rig_name);
        let opened = opened.map(|rig| worker.rig = Some(rig));
        if let Err(error) = opened {
            let elsewhere = matches!(&error, SessionError::Port { source, .. }
                if matches!(**source, rig::RigError::PortLocked { .. }));
            if elsewhere || matches!(error, SessionError::Sim { .. }) {
                return Err(error.into());
            }
            worker.show_trouble(&error.into());
        }
        // The queue hands over one task at a time.
        let (tasks, todo) = mpsc::channel(1);
        match place {
            WorkerPlace::Task => drop(tokio::spawn(worker.work(todo))),
            WorkerPlace::Thread => {
                std::thread::Builder::new()
                    .name("rig".to_owned())
                    .spawn(move || {
                        let runtime = tokio::runtime::Builder::new_current_thread()
                            .enable_all()
                            .build()
                            .expect("the system has timers");
                        runtime.block_on(worker.work(todo));
                    })
                    .map_err(DaemonError::Thread)?;
            }
        }
        Ok(tasks)
    }

    /// Opens the port, unless it is open.
    fn open(&mut self) -> Result<&mut OpenRig<S::Rig>, DaemonError> {
        if self.rig.is_none() {
            let name = &self.shared.settings.rig_name;
            self.rig = Some(self.source.open(&self.shared.rig, name)?);
            self.publish_snapshots();
        }
        Ok(self.rig.as_mut().expect("just opened"))
    }

    async fn work(mut self, mut todo: mpsc::Receiver<Task>) {
        // From here on, so that what the rig shows waits for nothing else that the program does.
        self.publish_snapshots();
        let mut looked = false;
        loop {
            let mut signal = self.signal.clone();
            let applied = self.applied;
            tokio::select! {
                () = pressed(&mut signal, applied) => self.make_safe().await,
                task = todo.recv() => match task {
                    Some(Task::RunJob { job, permit }) => {
                        let ending = self.run_job(&job, permit).await;
                        self.shared.activity(Activity::Idle);
                        self.report(WorkerEvent::Ended(ending)).await;
                    }
                    Some(Task::Move { to, permit, reply }) => self.travel(to, permit, reply).await,
                    Some(Task::Close) | None => return,
                },
                () = tokio::time::sleep(if looked { LOOK } else { Duration::ZERO }) => {
                    looked = true;
                    // A device that gives no reply does not keep a stop waiting.
                    tokio::select! {
                        biased;
                        () = pressed(&mut signal, applied) => {}
                        () = self.look() => {}
                    }
                }
            }
        }
    }

    /// Looks how the rig is; moves nothing. A lamp that a killed program left on goes out.
    async fn look(&mut self) {
        let known = self.shared.view.borrow().connected;
        if let Err(error) = self.meet(known).await {
            self.show_trouble(&error);
            // Whatever is at that port when it comes back may be something else.
            if gone(&error) {
                self.rig = None;
            }
        }
    }

    async fn meet(&mut self, known: bool) -> Result<(), DaemonError> {
        let fresh = self.rig.is_none();
        let rig = self.open()?;
        if !known || fresh {
            rig.start().await?;
            rig.drive.lamp(false).await.map_err(not_ready)?;
        }
        let seen = rig.drive.snapshot().await.map_err(not_ready)?;
        self.shared.view.send_if_modified(|view| {
            let before = view.clone();
            crate::view::show_snapshot(view, &seen);
            *view != before
        });
        Ok(())
    }

    /// Shows what every snapshot of the rig sees, as long as it is open.
    fn publish_snapshots(&mut self) {
        let Some(rig) = &self.rig else { return };
        let mut seen = rig.drive.watch();
        let shared = self.shared.clone();
        let follow = async move {
            while seen.changed().await.is_ok() {
                let snapshot = *seen.borrow_and_update();
                if let Some(snapshot) = snapshot {
                    shared
                        .view
                        .send_modify(|view| crate::view::show_snapshot(view, &snapshot));
                }
            }
        };
        tokio::spawn(follow);
    }

    /// Shows that the rig does not answer.
    fn show_trouble(&self, error: &DaemonError) {
        let text = chain(error);
        let changed = self.shared.view.send_if_modified(|view| {
            let changed = view.connected || view.trouble.as_ref() != Some(&text);
            view.connected = false;
            view.trouble = Some(text.clone());
            changed
        });
        if changed {
            self.shared.warn(text);
        }
    }

    /// Stops the arms of a rig that nothing else moves, lamp off. What is pressed meanwhile is carried out after it; an
    /// emergency stop does not wait for a stop.
    async fn make_safe(&mut self) {
        loop {
            let mut pressed = self.signal.clone();
            let now = *pressed.borrow_and_update();
            let at_once = now.emergency_stops != self.applied.emergency_stops;
            let stop = async {
                let Some(rig) = &mut self.rig else {
                    return Vec::new();
                };
                rig.drive.make_safe(at_once).await
            };
            let failed = tokio::select! {
                biased;
                failed = stop => failed,
                _ = pressed.wait_for(|signal| !at_once && signal.emergency_stops != now.emergency_stops) => continue,
            };
            self.applied = now;
            for error in failed {
                self.shared.warn(format!("while stopping: {}", chain(&error)));
            }
            return;
        }
    }

    /// Finishes some work that moves nothing, and carries out stops meanwhile.
    async fn attend<T>(&mut self, work: impl Future<Output = T>) -> T {
        let mut work = std::pin::pin!(work);
        loop {
            let (mut signal, applied) = (self.signal.clone(), self.applied);
            tokio::select! {
                biased;
                done = &mut work => return done,
                () = pressed(&mut signal, applied) => self.make_safe().await,
            }
        }
    }

    /// Latches the fault that ended a motion.
    fn latch(&self, code: FaultCode, text: String) {
        self.shared.operator.latch(code, text);
    }

    async fn report(&mut self, event: WorkerEvent) {
        // Nobody listens once the queue has ended.
        let _ = self.events.send(event).await;
    }
}

/// Returns once a stop has come that was not carried out yet.
async fn pressed(signal: &mut watch::Receiver<Signal>, applied: Signal) {
    if signal
        .wait_for(|signal| signal.stops != applied.stops)
        .await
        .is_err()
    {
        // Nobody is left who could press it.
        std::future::pending::<()>().await;
    }
}

/// Returns once what is under way is to come to rest before its end.
async fn stopped(command: &mut watch::Receiver<Command>) -> Command {
    let asked = command.wait_for(|command| *command != Command::Run).await;
    let asked = asked.map(|command| *command);
    match asked {
        Ok(command) => command,
        // Nobody is left who could ask.
        Err(_) => std::future::pending().await,
    }
}

fn not_ready<E: Fault>(error: DriveError<E>) -> DaemonError {
    SessionError::not_ready(error).into()
}

/// Whether the port is to be opened anew.
fn gone(error: &DaemonError) -> bool {
    matches!(
        error,
        DaemonError::Session(SessionError::NotReady {
            kind: FaultKind::Disconnected,
            ..
        })
    )
}
