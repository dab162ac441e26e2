//! A daemon in a folder of its own.

use std::path::PathBuf;
use std::time::SystemTime;

use goniod::{Activity, Caller, Daemon, Event, Events, Job, JobState, RigView, Settings, Submission, What};
use tempfile::TempDir;

/// Few readings, in simulated time.
pub(crate) const SHORT: &str = "[[plane]]\ntheta_r_deg = 60\nreadings = 12\n[arc]\nreadings = 8\n";

pub(crate) fn operator() -> Caller {
    Caller {
        name: "operator".to_owned(),
    }
}

/// A job like [`SHORT`] whose specimen lies on the stage.
pub(crate) fn on_stage() -> String {
    format!("on_stage = true\n{SHORT}")
}

pub(crate) fn submission(job: &str) -> Submission {
    Submission {
        job: job.to_owned(),
        name: "job.toml".to_owned(),
        whole: false,
    }
}

pub(crate) struct Bench {
    pub(crate) folder: TempDir,
    pub(crate) rig: String,
}

impl Bench {
    pub(crate) fn new(rig: &str) -> Self {
        Self {
            folder: TempDir::new().unwrap(),
            rig: rig.to_owned(),
        }
    }

    pub(crate) fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    pub(crate) fn settings(&self) -> Settings {
        Settings {
            rig: self.rig.clone(),
            rig_name: "rig.toml".to_owned(),
            data: self.data(),
            clock: SystemTime::now,
        }
    }

    pub(crate) async fn open(&self) -> Daemon {
        Daemon::open(self.settings()).await.unwrap()
    }
}

/// Reads events until one is looked for.
pub(crate) async fn until<T>(events: &mut Events, mut found: impl FnMut(&Event) -> Option<T>) -> T {
    loop {
        let event = events.next().await.expect("the daemon goes on");
        if let Some(found) = found(&event) {
            return found;
        }
    }
}

/// Waits until a job is in a state.
///
/// # Panics
/// If it ends in another.
pub(crate) async fn state(events: &mut Events, id: goniod::JobId, state: JobState) -> Job {
    until(events, |event| match &event.what {
        What::Job { job } if job.id == id && job.state == state => Some((**job).clone()),
        What::Job { job } if job.id == id => {
            let ended = job.state.over() || job.state == JobState::Interrupted;
            assert!(!ended, "not {state}: {job:?}");
            None
        }
        _ => None,
    })
    .await
}

/// Waits until so many readings were taken.
pub(crate) async fn readings(events: &mut Events, mut n: usize) {
    until(events, |event| {
        n -= usize::from(matches!(event.what, What::Reading { .. }));
        (n == 0).then_some(())
    })
    .await;
}

/// Waits until the rig looks as wanted.
pub(crate) async fn rig(daemon: &Daemon, wanted: impl FnMut(&RigView) -> bool) -> RigView {
    let mut rig = daemon.rig();
    rig.wait_for(wanted).await.expect("the daemon goes on").clone()
}

pub(crate) async fn idle(daemon: &Daemon) -> RigView {
    rig(daemon, |rig| rig.activity == Activity::Idle && rig.job.is_none()).await
}

/// Acknowledges the fault that is shown.
///
/// # Panics
/// If none is, or that is refused.
pub(crate) async fn acknowledge(daemon: &Daemon) {
    let fault = daemon.rig().borrow().fault.clone().expect("a fault is latched");
    daemon.acknowledge(&operator(), &fault.id).await.unwrap();
}
