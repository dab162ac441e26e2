use std::sync::Arc;

use capture::Command;
use tokio::sync::{mpsc, oneshot};

use crate::hand::Task;
use crate::lock::Lock;
use crate::shared::Shared;
use crate::state::Cause;
use crate::{DaemonError, FaultCode, Job, JobId, JobState, Refusal, What};

mod ask;
mod news;

pub(crate) use ask::Ask;
pub(crate) use news::{Ending, News, Verb};

/// Owns the queue: which job is next, and how each stands.
pub(crate) struct Queue {
    shared: Arc<Shared>,
    hand: mpsc::Sender<Task>,
    /// Jobs that are not over, in their order.
    jobs: Vec<Job>,
    current: Option<JobId>,
    /// Whether an arm is moved by hand.
    moving: bool,
    /// Whether no job may start that nobody said anything about since the program began.
    held: bool,
    closing: bool,
    /// Whom to tell once it has ended.
    closed: Vec<oneshot::Sender<()>>,
    _lock: Lock,
}

impl Queue {
    /// The queue of a store. What was under way is interrupted.
    ///
    /// # Errors
    /// The store cannot be read or written.
    pub(crate) async fn open(
        shared: Arc<Shared>,
        hand: mpsc::Sender<Task>,
        lock: Lock,
    ) -> Result<Self, DaemonError> {
        let mut jobs = shared.store.jobs(0).await?;
        for job in jobs.iter_mut().filter(|job| job.state.under_way()) {
            let Some(state) = job.state.after(Cause::Interrupt) else {
                continue;
            };
            job.state = state;
            job.why = Some("the program ended while it was under way".to_owned());
            job.changed = shared.now();
            shared.store.change_job(job).await?;
        }
        Ok(Self {
            held: !jobs.is_empty(),
            shared,
            hand,
            jobs,
            current: None,
            moving: false,
            closing: false,
            closed: Vec::new(),
            _lock: lock,
        })
    }

    /// Answers and listens until it is told to end.
    pub(crate) async fn run(
        mut self,
        mut asks: mpsc::Receiver<Ask>,
        mut news: mpsc::UnboundedReceiver<News>,
    ) {
        let mut orphaned = false;
        loop {
            if self.closing && self.current.is_none() && !self.moving {
                break;
            }
            self.next().await;
            tokio::select! {
                biased;
                Some(news) = news.recv() => self.hear(news).await,
                ask = asks.recv(), if !orphaned => match ask {
                    Some(ask) => self.answer(ask).await,
                    // The last handle was dropped without a word.
                    None => {
                        orphaned = true;
                        self.end();
                    }
                },
                else => break,
            }
        }
        let (reply, closed) = oneshot::channel();
        if self.hand.send(Task::Close { reply }).await.is_ok() {
            let _ = closed.await;
        }
        self.shared.store.close().await;
        self.shared.log.close();
        for reply in self.closed {
            let _ = reply.send(());
        }
    }

    /// Has the reading finished and the capture ended.
    fn end(&mut self) {
        self.closing = true;
        self.shared.command.send_if_modified(|command| {
            let end = matches!(command, Command::Run | Command::Pause);
            if end {
                *command = Command::Finish;
            }
            end
        });
    }

    /// Brings the next job forward, where nothing stands in the way.
    async fn next(&mut self) {
        self.held &= !self.jobs.is_empty();
        if self.current.is_some() || self.closing {
            return;
        }
        let ahead = |job: &&Job| matches!(job.state, JobState::Queued | JobState::AwaitingSpecimen);
        let Some(job) = self.jobs.iter().find(ahead) else {
            return;
        };
        let (id, on_stage) = (job.id, job.on_stage);
        if job.state == JobState::AwaitingSpecimen {
            return;
        }
        let interrupted = self.jobs.iter().any(|job| job.state == JobState::Interrupted);
        // What an operator asked for while one job ended must not be lost on the next.
        let told = *self.shared.command.borrow() != Command::Run;
        if !on_stage || self.held || interrupted || told {
            self.change(id, Cause::Turn, None).await;
        } else if self.free().is_ok() {
            self.set_off(id, Cause::Start).await;
        }
    }

    /// Whether a motion may begin.
    fn free(&self) -> Result<(), Refusal> {
        if let Some(fault) = self.shared.fault() {
            return Err(Refusal::conflict(format!(
                "a fault is latched ({}): acknowledge it first",
                fault.text
            )));
        }
        if *self.shared.command.borrow() == Command::Estop {
            return Err(Refusal::conflict("the emergency stop is not acknowledged"));
        }
        if let Some(id) = self.current {
            return Err(Refusal::conflict(format!("job {id} is under way")));
        }
        if self.moving {
            return Err(Refusal::conflict("the arms are being moved by hand"));
        }
        if self.closing {
            return Err(Refusal::unavailable("the daemon is shutting down"));
        }
        Ok(())
    }

    /// Hands a job to the rig.
    async fn set_off(&mut self, id: JobId, cause: Cause) {
        self.change(id, cause, None).await;
        let Some(job) = self.jobs.iter().find(|job| job.id == id).cloned() else {
            return;
        };
        self.current = Some(id);
        self.shared.view.send_modify(|view| {
            view.job = Some(id);
            view.run.clone_from(&job.run);
            view.progress = None;
        });
        if self.hand.send(Task::Carry(Box::new(job))).await.is_err() {
            let why = "the thread of the rig has ended; restart the daemon".to_owned();
            let fault = Some(FaultCode::Setup);
            self.ended(Ending::Interrupted { why, fault }).await;
        }
    }

    /// Takes back what was asked of the motion before; an emergency stop stays.
    fn clear_command(&self) {
        self.shared.command.send_if_modified(|command| {
            let stale = !matches!(command, Command::Estop | Command::Run);
            if stale {
                *command = Command::Run;
            }
            stale
        });
    }

    /// Changes a job's state, where the table allows it.
    async fn change(&mut self, id: JobId, cause: Cause, why: Option<String>) {
        let Some(job) = self.jobs.iter_mut().find(|job| job.id == id) else {
            return;
        };
        let Some(state) = job.state.after(cause) else {
            return;
        };
        job.state = state;
        job.why = why;
        job.changed = self.shared.now();
        let changed = job.clone();
        if state.over() {
            self.jobs.retain(|job| job.id != id);
        }
        self.shared.keep(&changed).await;
        self.shared.tell(What::Job {
            job: Box::new(changed),
        });
    }
}
