use arms::{Arm, ArmAngle};
use capture::Command;
use tokio::sync::oneshot;

use super::Queue;
use crate::daemon::Reply;
use crate::hand::Task;
use crate::refusal::chain;
use crate::state::Cause;
use crate::{Action, Job, JobId, JobState, Order, Refusal, RefusalKind, What};

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

impl Queue {
    pub(super) async fn answer(&mut self, ask: Ask) {
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

    pub(super) async fn audit(&self, who: &str, what: &str, outcome: &str) {
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
}
