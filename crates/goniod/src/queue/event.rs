use capture::Command;

use super::Queue;
use crate::operator::Signal;
use api::{Cause, VerdictView};

/// What the rig's worker tells the queue.
pub(crate) enum WorkerEvent {
    /// The job under way has a run.
    Begun { run: String },
    /// The files of the run under way were written, and its checks judged it.
    Reported { verdict: VerdictView },
    /// The job under way ended.
    Ended(Ending),
    /// A motion by hand ended, or was refused.
    Moved,
}

/// How the worker left a job.
#[derive(Debug)]
pub(crate) enum Ending {
    /// Measured and reported.
    Done,
    /// It can go on.
    Interrupted { why: String },
    /// It cannot be done.
    Failed { why: String },
}

impl Queue {
    /// Notes in the job under way what the operator asked for, and whether it holds.
    pub(super) async fn follow(&mut self, signal: Signal) {
        let Some(id) = self.current else { return };
        if matches!(signal.command, Command::Finish | Command::Stop | Command::Estop) {
            return self.change(id, Cause::Halt, None).await;
        }
        let cause = match *self.holding.borrow_and_update() {
            true => Cause::Hold,
            false => Cause::Proceed,
        };
        self.change(id, cause, None).await;
    }

    pub(super) async fn handle(&mut self, event: WorkerEvent) {
        match event {
            WorkerEvent::Begun { run } => {
                self.shared.view.send_modify(|view| view.run = Some(run.clone()));
                if let Some(job) = self.jobs.iter_mut().find(|job| Some(job.id) == self.current) {
                    job.run = Some(run);
                }
            }
            WorkerEvent::Reported { verdict } => {
                if let Some(job) = self.jobs.iter_mut().find(|job| Some(job.id) == self.current) {
                    job.verdict = Some(verdict);
                }
            }
            WorkerEvent::Ended(ending) => self.end_job(ending).await,
            WorkerEvent::Moved => self.moving = false,
        }
    }

    pub(super) async fn end_job(&mut self, ending: Ending) {
        let Some(id) = self.current.take() else { return };
        let (cause, why) = match ending {
            Ending::Done => (Cause::Complete, None),
            Ending::Failed { why } => (Cause::Fail, Some(why)),
            Ending::Interrupted { why } => (Cause::Interrupt, Some(why)),
        };
        self.change(id, cause, why).await;
        self.shared.view.send_modify(|view| {
            view.job = None;
            view.run = None;
            view.progress = None;
        });
    }
}
