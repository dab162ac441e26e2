use std::sync::Arc;

use arms::{Arm, ArmAngle};
use capture::Command;
use tokio::sync::{mpsc, oneshot};

use crate::daemon::Reply;
use crate::hand::Task;
use crate::lock::Lock;
use crate::refusal::chain;
use crate::shared::Shared;
use crate::state::Cause;
use crate::{
    Action, DaemonError, FaultCode, FaultView, Job, JobId, JobState, Order, Refusal, RefusalKind, What,
};

/// Most jobs that may wait.
const WAITING: usize = 1000;

/// What is asked of the queue.
pub(crate) enum Ask {
    Submit {
        order: Box<Order>,
        reply: Reply<Job>,
    },
    Act {
        id: JobId,
        action: Action,
        reply: Reply<Job>,
    },
    Acknowledge {
        reply: Reply<()>,
    },
    /// One arm to an angle, or both to rest.
    Move {
        to: Option<(Arm, ArmAngle)>,
        reply: Reply<()>,
    },
    Shutdown {
        reply: oneshot::Sender<()>,
    },
}

/// What an operator did past the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verb {
    Pause,
    Proceed,
    Finish,
    Stop,
    Estop,
}

impl std::fmt::Display for Verb {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Pause => "pause",
            Self::Proceed => "go on",
            Self::Finish => "finish",
            Self::Stop => "stop",
            Self::Estop => "emergency stop",
        })
    }
}

/// What the queue is told.
pub(crate) enum News {
    /// An operator gave the capture a command.
    Verb { by: String, verb: Verb },
    /// The job under way has a run.
    Begun { run: String },
    /// The capture holds, or goes on.
    Holding(bool),
    /// The job under way ended.
    Ended(Ending),
    /// A motion by hand ended, in a fault or not.
    Moved(Option<(FaultCode, String)>),
}

/// How the hand left a job.
#[derive(Debug)]
pub(crate) enum Ending {
    /// Measured and reported.
    Done,
    /// It can go on.
    Interrupted { why: String, fault: Option<FaultCode> },
    /// It cannot be done.
    Failed { why: String },
}

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

    async fn answer(&mut self, ask: Ask) {
        match ask {
            Ask::Submit { order, reply } => {
                let result = self.submit(&order, &reply.by.name).await;
                let what = format!("submit {}", order.job.name);
                self.reply(reply, &what, result).await;
            }
            Ask::Act { id, action, reply } => {
                let result = self.act(id, action).await;
                self.reply(reply, &format!("{action:?} {id}").to_lowercase(), result)
                    .await;
            }
            Ask::Acknowledge { reply } => {
                let result = self.acknowledge(&reply.by.name).await;
                self.reply(reply, "acknowledge", result).await;
            }
            Ask::Move { to, reply } => {
                let what = match to {
                    Some((arm, angle)) => format!("jog {arm} to {:.3}°", angle.deg()),
                    None => "park".to_owned(),
                };
                let result = self.set_moving(to).await;
                self.reply(reply, &what, result).await;
            }
            Ask::Shutdown { reply } => {
                self.closed.push(reply);
                self.end();
            }
        }
    }

    /// Notes what was asked and what came of it, and answers.
    async fn reply<T>(&self, reply: Reply<T>, what: &str, result: Result<T, Refusal>) {
        let outcome = match &result {
            Ok(_) => "done".to_owned(),
            Err(refusal) => refusal.to_string(),
        };
        self.audit(&reply.by.name, what, &outcome).await;
        // Whoever asked may have gone.
        let _ = reply.answer.send(result);
    }

    async fn audit(&self, who: &str, what: &str, outcome: &str) {
        tracing::info!(who, what, outcome, "asked");
        let now = self.shared.now();
        if let Err(error) = self.shared.store.audit(&now, who, what, outcome).await {
            tracing::error!(who, what, outcome, "not in the audit: {}", chain(&error));
        }
    }

    async fn submit(&mut self, order: &Order, by: &str) -> Result<Job, Refusal> {
        if self.closing {
            return Err(Refusal::unavailable("the daemon is shutting down"));
        }
        if self.jobs.len() >= WAITING {
            return Err(Refusal::new(
                RefusalKind::Busy,
                format!("{WAITING} jobs are waiting already"),
            ));
        }
        let now = self.shared.now();
        let mut job = Job {
            id: JobId::generate(),
            place: 0,
            name: order.job.name.clone(),
            specimen: order.job.specimen.clone(),
            on_stage: order.job.on_stage,
            text: order.job_text.clone(),
            state: JobState::Queued,
            why: None,
            run: None,
            by: by.to_owned(),
            submitted: now.clone(),
            changed: now,
        };
        self.shared.store.add_job(&mut job).await?;
        self.jobs.push(job.clone());
        self.shared.tell(What::Job {
            job: Box::new(job.clone()),
        });
        Ok(job)
    }

    async fn act(&mut self, id: JobId, action: Action) -> Result<Job, Refusal> {
        let Some(job) = self.jobs.iter().find(|job| job.id == id) else {
            return Err(match self.shared.store.job(id).await? {
                Some(job) => Refusal::conflict(format!("job {id} is {}", job.state)),
                None => Refusal::new(RefusalKind::NotFound, format!("there is no job {id}")),
            });
        };
        let cause = match action {
            Action::Ready => Cause::Start,
            Action::Cancel => Cause::Cancel,
            Action::Resume => Cause::Resume,
        };
        if job.state.after(cause).is_none() {
            let word = format!("{action:?}").to_lowercase();
            return Err(Refusal::conflict(format!(
                "job {id} is {}: {word} is not possible",
                job.state
            )));
        }
        if action == Action::Cancel {
            return self.cancel(job.clone()).await;
        }
        self.free()?;
        self.held = false;
        self.clear_command();
        self.set_off(id, cause).await;
        let job = self.jobs.iter().find(|job| job.id == id);
        Ok(job.expect("a job that was set off is not over").clone())
    }

    /// Gives a job up, unless that cannot be stored.
    async fn cancel(&mut self, mut job: Job) -> Result<Job, Refusal> {
        job.state = JobState::Cancelled;
        job.why = None;
        job.changed = self.shared.now();
        self.shared.store.change_job(&job).await?;
        self.jobs.retain(|other| other.id != job.id);
        self.shared.tell(What::Job {
            job: Box::new(job.clone()),
        });
        Ok(job)
    }

    async fn acknowledge(&mut self, by: &str) -> Result<(), Refusal> {
        let pressed = *self.shared.command.borrow() == Command::Estop;
        if self.shared.fault().is_none() && !pressed {
            return Err(Refusal::conflict("no fault is latched"));
        }
        if self.current.is_some() || self.moving {
            return Err(Refusal::conflict("the rig is still coming to rest; try again"));
        }
        self.shared.store.acknowledge(by, &self.shared.now()).await?;
        self.shared.command.send_replace(Command::Run);
        self.shared.view.send_modify(|view| view.fault = None);
        self.shared.tell(What::Acknowledged { by: by.to_owned() });
        Ok(())
    }

    async fn set_moving(&mut self, to: Option<(Arm, ArmAngle)>) -> Result<(), Refusal> {
        self.free()?;
        self.clear_command();
        let (reply, begun) = oneshot::channel();
        let gone = || Refusal::unavailable("the thread of the rig has ended; restart the daemon");
        self.hand
            .send(Task::Move { to, reply })
            .await
            .map_err(|_| gone())?;
        self.moving = true;
        let result = begun.await.map_err(|_| gone()).flatten();
        self.moving = result.is_ok();
        result
    }

    async fn hear(&mut self, news: News) {
        match news {
            News::Verb { by, verb } => {
                if verb == Verb::Estop {
                    self.latch(FaultCode::Estop, format!("emergency stop by {by}"))
                        .await;
                }
                if matches!(verb, Verb::Finish | Verb::Stop | Verb::Estop)
                    && let Some(id) = self.current
                {
                    self.change(id, Cause::Halt, None).await;
                }
                self.audit(&by, &verb.to_string(), "done").await;
            }
            News::Begun { run } => {
                self.shared.view.send_modify(|view| view.run = Some(run.clone()));
                if let Some(job) = self.jobs.iter_mut().find(|job| Some(job.id) == self.current) {
                    job.run = Some(run);
                }
            }
            News::Holding(holding) => {
                let cause = if holding { Cause::Hold } else { Cause::Proceed };
                if let Some(id) = self.current {
                    self.change(id, cause, None).await;
                }
            }
            News::Ended(ending) => self.ended(ending).await,
            News::Moved(fault) => {
                self.moving = false;
                if let Some((code, text)) = fault {
                    self.latch(code, text).await;
                }
            }
        }
    }

    async fn ended(&mut self, ending: Ending) {
        let Some(id) = self.current.take() else { return };
        let (cause, why) = match ending {
            Ending::Done => (Cause::Complete, None),
            Ending::Failed { why } => (Cause::Fail, Some(why)),
            Ending::Interrupted { why, fault } => {
                if let Some(code) = fault {
                    self.latch(code, why.clone()).await;
                }
                (Cause::Interrupt, Some(why))
            }
        };
        self.change(id, cause, why).await;
        self.shared.view.send_modify(|view| {
            view.job = None;
            view.run = None;
            view.progress = None;
        });
    }

    /// Latches a fault. The first one that is not acknowledged is shown.
    async fn latch(&mut self, code: FaultCode, text: String) {
        let known = self.shared.fault();
        if known.as_ref().is_some_and(|known| known.code == code) {
            return;
        }
        let run = self.shared.view.borrow().run.clone();
        let fault = FaultView {
            code,
            text,
            at: self.shared.now(),
            run,
        };
        tracing::error!(?code, "fault: {}", fault.text);
        self.shared.view.send_modify(|view| {
            view.fault.get_or_insert(fault.clone());
        });
        if let Err(error) = self.shared.store.latch(&fault).await {
            tracing::error!("the fault is not in the store: {}", chain(&error));
        }
        self.shared.tell(What::Fault { fault });
    }

    /// Changes a job's state, where the table allows it. A store that refuses is a warning: what the rig does is true
    /// all the same, and after a restart the job counts as interrupted.
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
        // Who hears of it and asks the store must find it there.
        if let Err(error) = self.shared.store.change_job(&changed).await {
            self.shared.warn(format!(
                "the state of job {id} is not in the store: {}",
                chain(&error)
            ));
        }
        self.shared.tell(What::Job {
            job: Box::new(changed),
        });
    }
}
