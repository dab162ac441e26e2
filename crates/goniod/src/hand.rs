use std::sync::Arc;
use std::time::Duration;

use arms::{Arm, ArmAngle};
use capture::Command;
use rig::FaultKind;
use tokio::sync::{mpsc, oneshot, watch};

use crate::queue::News;
use crate::refusal::chain;
use crate::shared::Shared;
use crate::station::Station;
use crate::{Activity, DaemonError, Job, Refusal};

mod carry;
mod observer;
mod travel;

/// Time between two looks at a rig that has nothing to do.
const LOOK: Duration = Duration::from_secs(1);

/// What the hand is to do.
pub(crate) enum Task {
    /// Carry a job through, or go on with it.
    Carry(Box<Job>),
    /// Move one arm, or both to rest; answers once the motion was checked.
    Move {
        to: Option<(Arm, ArmAngle)>,
        reply: oneshot::Sender<Result<(), Refusal>>,
    },
    /// Release the rig and end.
    Close { reply: oneshot::Sender<()> },
}

/// Owns the rig, on a thread of its own: whatever else the program is busy with does not keep a capture waiting.
pub(crate) struct Hand {
    shared: Arc<Shared>,
    news: mpsc::UnboundedSender<News>,
    command: watch::Receiver<Command>,
    /// The rig, while it can be reached.
    station: Option<Station>,
}

impl Hand {
    /// Opens the rig where it can be, and starts the thread.
    ///
    /// # Errors
    /// Another program has the port; the `[sim]` table is wrong; there is no thread to be had.
    pub(crate) fn start(
        shared: Arc<Shared>,
        news: mpsc::UnboundedSender<News>,
    ) -> Result<mpsc::Sender<Task>, DaemonError> {
        let mut hand = Self {
            command: shared.command.subscribe(),
            shared,
            news,
            station: None,
        };
        if let Err(error) = hand.open() {
            let elsewhere = matches!(&error, DaemonError::Port { source, .. }
                if matches!(**source, rig::RigError::PortLocked { .. }));
            if elsewhere || matches!(error, DaemonError::Sim { .. }) {
                return Err(error);
            }
            hand.trouble(&error);
        }
        // The queue hands over one task at a time.
        let (tasks, todo) = mpsc::channel(1);
        std::thread::Builder::new()
            .name("rig".to_owned())
            .spawn(move || {
                let runtime = tokio::runtime::Builder::new_current_thread()
                    .enable_all()
                    .build()
                    .expect("the system has timers");
                runtime.block_on(hand.work(todo));
            })
            .map_err(DaemonError::Thread)?;
        Ok(tasks)
    }

    /// Opens the port, unless it is open.
    fn open(&mut self) -> Result<&mut Station, DaemonError> {
        if self.station.is_none() {
            self.station = Some(Station::open(&self.shared.rig, &self.shared.settings.rig_name)?);
        }
        Ok(self.station.as_mut().expect("just opened"))
    }

    async fn work(mut self, mut todo: mpsc::Receiver<Task>) {
        self.follow();
        let mut met = false;
        loop {
            tokio::select! {
                biased;
                () = pressed(&mut self.command) => self.halt().await,
                task = todo.recv() => match task {
                    Some(Task::Carry(job)) => {
                        let ending = self.carry(&job).await;
                        self.shared.activity(Activity::Idle);
                        self.say(News::Ended(ending));
                    }
                    Some(Task::Move { to, reply }) => {
                        if let Some(fault) = self.travel(to, reply).await {
                            self.shared.activity(Activity::Idle);
                            self.say(News::Moved(fault));
                        }
                    }
                    Some(Task::Close { reply }) => {
                        drop(self.station.take());
                        let _ = reply.send(());
                        return;
                    }
                    None => return,
                },
                () = tokio::time::sleep(if met { LOOK } else { Duration::ZERO }) => {
                    self.look().await;
                    met = true;
                }
            }
        }
    }

    /// Looks how the rig is; moves nothing. A lamp that a killed program left on goes out.
    async fn look(&mut self) {
        let known = self.shared.view.borrow().connected;
        if let Err(error) = self.meet(known).await {
            self.trouble(&error);
            // Whatever is at that port when it comes back may be something else.
            if gone(&error) {
                self.station = None;
            }
        }
    }

    async fn meet(&mut self, known: bool) -> Result<(), DaemonError> {
        let fresh = self.station.is_none();
        let station = self.open()?;
        if !known || fresh {
            station.start().await?;
            station.drive.lamp(false).await.map_err(not_ready)?;
        }
        let seen = station.drive.snapshot().await.map_err(not_ready)?;
        if fresh {
            self.follow();
        }
        self.shared.view.send_if_modified(|view| {
            let before = view.clone();
            crate::view::show_snapshot(view, &seen);
            *view != before
        });
        Ok(())
    }

    /// Shows what every snapshot of the rig sees, as long as it is open.
    fn follow(&mut self) {
        let Some(station) = &self.station else { return };
        let mut seen = station.drive.watch();
        let shared = self.shared.clone();
        tokio::spawn(async move {
            while seen.changed().await.is_ok() {
                let snapshot = *seen.borrow_and_update();
                if let Some(snapshot) = snapshot {
                    shared
                        .view
                        .send_modify(|view| crate::view::show_snapshot(view, &snapshot));
                }
            }
        });
    }

    /// Shows that the rig does not answer.
    fn trouble(&self, error: &DaemonError) {
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

    /// Emergency stop of a rig that has nothing to do: arms halted, lamp off.
    async fn halt(&mut self) {
        let Some(station) = &mut self.station else { return };
        let mut failed = station.drive.halt_all().await;
        failed.extend(station.drive.disengage_all().await);
        for error in failed {
            self.shared.warn(format!("while stopping: {}", chain(&error)));
        }
    }

    fn say(&self, news: News) {
        // Nobody listens once the queue has ended.
        let _ = self.news.send(news);
    }
}

/// Returns when the emergency stop is pressed anew.
async fn pressed(command: &mut watch::Receiver<Command>) {
    loop {
        if command.changed().await.is_err() {
            // Nobody is left who could press it.
            std::future::pending::<()>().await;
        }
        if *command.borrow_and_update() == Command::Estop {
            return;
        }
    }
}

fn not_ready(error: rig::DriveError<rig::RigError>) -> DaemonError {
    DaemonError::NotReady(Box::new(error))
}

/// Whether the port is to be opened anew.
fn gone(error: &DaemonError) -> bool {
    matches!(error, DaemonError::NotReady(error) if error.kind() == FaultKind::Disconnected)
}
