use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use rig::RigFile;
use tokio::sync::watch;

use crate::audit::Audit;
use crate::event::Log;
use crate::operator::OperatorControl;
use crate::refusal::chain;
use crate::{Activity, Job, JobId, RigView, Settings, Store, What};

/// What the handles, the queue and the worker share: all of it can be read or written at once, nothing waits.
pub(crate) struct Shared {
    pub(crate) settings: Settings,
    pub(crate) rig: RigFile,
    pub(crate) store: Arc<dyn Store>,
    /// What the operator said last; straight to what moves, past everything else.
    pub(crate) operator: Arc<OperatorControl>,
    pub(crate) audit: Audit,
    /// Whether the capture holds, on the operator's wish.
    pub(crate) holding: watch::Sender<bool>,
    pub(crate) view: watch::Sender<RigView>,
    pub(crate) log: Arc<Log>,
    /// Held while a file of a run is made that somebody asked for.
    pub(crate) making: tokio::sync::Mutex<()>,
    /// Jobs as they are, where the store refused to keep how they changed.
    pub(crate) unkept: Mutex<HashMap<JobId, Job>>,
}

impl Shared {
    /// Wall clock, RFC 3339, UTC. Only ever shown: nothing depends on its going forward.
    pub(crate) fn now(&self) -> String {
        humantime::format_rfc3339_millis((self.settings.clock)()).to_string()
    }

    pub(crate) fn time(&self) -> SystemTime {
        (self.settings.clock)()
    }

    pub(crate) fn runs(&self) -> PathBuf {
        self.settings.data.join("runs")
    }

    pub(crate) fn publish(&self, what: What) {
        self.log.publish(self.now(), what);
    }

    pub(crate) fn warn(&self, text: String) {
        tracing::warn!("{text}");
        self.publish(What::Warning { text });
    }

    /// Keeps how a job changed. A store that refuses is a warning: what the rig does is true all the same, and after a
    /// restart the job counts as interrupted.
    pub(crate) async fn keep(&self, job: &Job) {
        // Who hears of it and asks the store must find it there.
        let kept = self.store.change_job(job).await;
        let mut unkept = self.unkept.lock().unwrap_or_else(PoisonError::into_inner);
        match kept {
            Ok(()) => unkept.remove(&job.id),
            Err(_) => unkept.insert(job.id, job.clone()),
        };
        drop(unkept);
        if let Err(error) = kept {
            self.warn(format!(
                "the state of job {} is not in the store: {}",
                job.id,
                chain(&error)
            ));
        }
    }

    /// What the store has of a job, or how it changed since the store refuses.
    pub(crate) fn latest(&self, job: Job) -> Job {
        let unkept = self.unkept.lock().unwrap_or_else(PoisonError::into_inner);
        unkept.get(&job.id).cloned().unwrap_or(job)
    }

    pub(crate) fn activity(&self, activity: Activity) {
        let changed = self.view.send_if_modified(|view| {
            let changed = view.activity != activity;
            view.activity = activity;
            changed
        });
        if changed {
            self.publish(What::Activity { activity });
        }
    }
}
