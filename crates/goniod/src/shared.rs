use std::path::PathBuf;
use std::sync::Arc;
use std::time::SystemTime;

use capture::Command;
use rig::RigFile;
use tokio::sync::watch;

use crate::event::Log;
use crate::{Activity, FaultView, RigView, Settings, Store, What};

/// What the handles, the queue and the hand share: all of it can be read or told at once, nothing waits.
pub(crate) struct Shared {
    pub(crate) settings: Settings,
    pub(crate) rig: RigFile,
    pub(crate) store: Arc<dyn Store>,
    /// What the operator wants of the capture; straight to it, past everything else.
    pub(crate) command: watch::Sender<Command>,
    pub(crate) view: watch::Sender<RigView>,
    pub(crate) log: Arc<Log>,
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

    pub(crate) fn tell(&self, what: What) {
        self.log.tell(self.now(), what);
    }

    pub(crate) fn warn(&self, text: String) {
        tracing::warn!("{text}");
        self.tell(What::Warning { text });
    }

    pub(crate) fn activity(&self, activity: Activity) {
        let changed = self.view.send_if_modified(|view| {
            let changed = view.activity != activity;
            view.activity = activity;
            changed
        });
        if changed {
            self.tell(What::Activity { activity });
        }
    }

    pub(crate) fn fault(&self) -> Option<FaultView> {
        self.view.borrow().fault.clone()
    }
}
