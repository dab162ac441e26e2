use super::Queue;
use crate::refusal::chain;
use crate::state::Cause;
use crate::{FaultCode, FaultView, What};

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

impl Queue {
    pub(super) async fn hear(&mut self, news: News) {
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

    pub(super) async fn ended(&mut self, ending: Ending) {
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
}
