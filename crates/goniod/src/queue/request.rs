use arms::{Arm, ArmAngle};

use super::Queue;
use crate::daemon::Reply;
use crate::operator::{Purpose, Receipt};
use crate::worker::Task;
use crate::{Action, Job, JobId, JobState, Refusal, RefusalKind, What};
use api::Cause;
use session::RunRequest;

/// Most jobs that may wait.
const WAITING: usize = 1000;

/// What is asked of the queue.
pub(crate) enum Request {
    Submit {
        order: Box<RunRequest>,
        /// Whether the run directory gets all files.
        whole: bool,
        receipt: Receipt,
        reply: Reply<Job>,
    },
    Act {
        id: JobId,
        action: Action,
        receipt: Receipt,
        reply: Reply<Job>,
    },
    /// One arm to an angle, or both to rest.
    Move {
        to: Option<(Arm, ArmAngle)>,
        receipt: Receipt,
        reply: Reply<()>,
    },
}

impl Queue {
    pub(super) async fn answer(&mut self, request: Request) {
        match request {
            Request::Submit {
                order,
                whole,
                receipt,
                reply,
            } => {
                let result = self.submit(&order, whole, receipt, &reply.by.name).await;
                reply.send(&self.shared, &format!("submit {}", order.job.name), result);
            }
            Request::Act {
                id,
                action,
                receipt,
                reply,
            } => {
                let result = self.act(id, action, receipt).await;
                reply.send(&self.shared, &format!("{action:?} {id}").to_lowercase(), result);
            }
            Request::Move { to, receipt, reply } => self.set_moving(to, receipt, reply).await,
        }
    }

    async fn submit(
        &mut self,
        order: &RunRequest,
        whole: bool,
        receipt: Receipt,
        by: &str,
    ) -> Result<Job, Refusal> {
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
            specimen: order.job.specimen.name.clone(),
            on_stage: order.job.on_stage,
            text: order.job_text.clone(),
            state: JobState::Queued,
            why: None,
            run: None,
            verdict: None,
            whole,
            by: by.to_owned(),
            submitted: now.clone(),
            changed: now,
        };
        let store = self.shared.store.clone();
        store.add_job(&mut job).await?;
        let alone = self.jobs.is_empty();
        self.jobs.push(job.clone());
        self.shared.publish(What::Job {
            job: Box::new(job.clone()),
        });
        // That its specimen is on the stage holds for the stage as it is now: once another job has had it, or something
        // has stopped the rig, somebody is asked.
        if job.on_stage
            && alone
            && self.free().is_ok()
            && let Ok(permit) = self.shared.operator.permit(receipt, Purpose::Submission)
        {
            self.start(job.id, Cause::Start, permit).await;
        }
        Ok(job)
    }

    async fn act(&mut self, id: JobId, action: Action, receipt: Receipt) -> Result<Job, Refusal> {
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
        let permit = self.shared.operator.permit(receipt, Purpose::Start)?;
        self.start(id, cause, permit).await;
        let job = self.jobs.iter().find(|job| job.id == id);
        Ok(job.expect("a job that was started is not over").clone())
    }

    /// Gives a job up, unless that cannot be stored.
    async fn cancel(&mut self, mut job: Job) -> Result<Job, Refusal> {
        job.state = JobState::Cancelled;
        job.why = None;
        job.changed = self.shared.now();
        self.shared.store.change_job(&job).await?;
        self.jobs.retain(|other| other.id != job.id);
        self.shared.publish(What::Job {
            job: Box::new(job.clone()),
        });
        Ok(job)
    }

    /// Has the worker move the arms; it answers.
    async fn set_moving(&mut self, to: Option<(Arm, ArmAngle)>, receipt: Receipt, reply: Reply<()>) {
        let permit = self
            .free()
            .and_then(|()| self.shared.operator.permit(receipt, Purpose::Jog));
        let permit = match permit {
            Ok(permit) => permit,
            Err(refusal) => return reply.send(&self.shared, "move", Err(refusal)),
        };
        self.moving = true;
        if self.worker.send(Task::Move { to, permit, reply }).await.is_err() {
            // Whoever asked is told by the answer that never comes.
            self.moving = false;
        }
    }
}
