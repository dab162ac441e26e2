use std::sync::Arc;

use tokio::sync::{mpsc, watch};

use crate::lock::Lock;
use crate::operator::{Permit, Signal};
use crate::shared::Shared;
use crate::worker::Task;
use crate::{DaemonError, FaultCode, Job, JobId, JobState, Refusal, What};
use api::Cause;

mod event;
mod request;

pub(crate) use event::{Ending, WorkerEvent};
pub(crate) use request::Request;

/// Owns the queue: which job is next, and how each stands.
pub(crate) struct Queue {
    shared: Arc<Shared>,
    worker: mpsc::Sender<Task>,
    /// Jobs that are not over, in their order.
    jobs: Vec<Job>,
    current: Option<JobId>,
    /// Whether an arm is moved by hand.
    moving: bool,
    /// What the operator does.
    signal: watch::Receiver<Signal>,
    /// Whether the capture holds, on the operator's wish.
    holding: watch::Receiver<bool>,
    _lock: Lock,
}

impl Queue {
    /// The queue of a store. What was under way is interrupted.
    ///
    /// # Errors
    /// The store cannot be read or written.
    pub(crate) async fn open(
        shared: Arc<Shared>,
        worker: mpsc::Sender<Task>,
        lock: Lock,
    ) -> Result<Self, DaemonError> {
        let mut jobs = shared.store.waiting_jobs().await?;
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
            signal: shared.operator.subscribe(),
            holding: shared.holding.subscribe(),
            shared,
            worker,
            jobs,
            current: None,
            moving: false,
            _lock: lock,
        })
    }

    /// Answers and listens until it is to end.
    pub(crate) async fn run(
        mut self,
        mut requests: mpsc::Receiver<Request>,
        mut events: mpsc::Receiver<WorkerEvent>,
        ended: watch::Sender<bool>,
    ) {
        let mut orphaned = false;
        loop {
            let signal = *self.signal.borrow_and_update();
            if signal.closing && self.current.is_none() && !self.moving {
                break;
            }
            self.follow(signal).await;
            self.take_turn().await;
            tokio::select! {
                biased;
                Some(event) = events.recv() => self.handle(event).await,
                _ = self.signal.changed() => {}
                _ = self.holding.changed() => {}
                request = requests.recv(), if !orphaned && !signal.closing => match request {
                    Some(request) => self.answer(request).await,
                    // The last handle was dropped without a word.
                    None => {
                        orphaned = true;
                        self.shared.operator.close();
                    }
                },
            }
        }
        // Whoever still waits for an answer is told that the daemon has ended.
        drop(requests);
        if self.worker.send(Task::Close).await.is_ok() {
            self.worker.closed().await;
        }
        self.shared.audit.close().await;
        // An error was logged when it came up.
        let _ = self.shared.operator.kept().await;
        self.shared.store.close().await;
        self.shared.log.close();
        drop(self._lock);
        ended.send_replace(true);
    }

    /// Brings the first waiting job forward. It starts only once somebody says that its specimen is on the stage.
    async fn take_turn(&mut self) {
        if self.current.is_some() || self.signal.borrow().closing {
            return;
        }
        let waiting = |job: &&Job| matches!(job.state, JobState::Queued | JobState::AwaitingSpecimen);
        if let Some(job) = self.jobs.iter().find(waiting)
            && job.state == JobState::Queued
        {
            self.change(job.id, Cause::Turn, None).await;
        }
    }

    /// Whether a job could begin, were it not for the operator.
    fn free(&self) -> Result<(), Refusal> {
        if let Some(id) = self.current {
            return Err(Refusal::conflict(format!("job {id} is under way")));
        }
        if self.moving {
            return Err(Refusal::conflict("the arms are being moved by hand"));
        }
        Ok(())
    }

    /// Hands a job to the rig.
    async fn start(&mut self, id: JobId, cause: Cause, permit: Permit) {
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
        let task = Task::RunJob {
            job: Box::new(job),
            permit,
        };
        if self.worker.send(task).await.is_err() {
            let why = "the thread of the rig has ended; restart the daemon".to_owned();
            self.shared.operator.latch(FaultCode::Setup, why.clone());
            self.end_job(Ending::Interrupted { why }).await;
        }
    }

    /// Changes a job's state, where the table allows it.
    async fn change(&mut self, id: JobId, cause: Cause, why: Option<String>) {
        let Some(job) = self.jobs.iter_mut().find(|job| job.id == id) else {
            return;
        };
        let Some(state) = job.state.after(cause).filter(|&state| state != job.state) else {
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
        self.shared.publish(What::Job {
            job: Box::new(changed),
        });
    }
}
