//! The capture daemon as a library: a queue of jobs that loses nothing, and the rig that works it off.
//!
//! [`Daemon`] is the service: it keeps jobs, runs and readings in a [`Store`], carries one job after the other
//! through, and obeys an operator at once; [`http`] lets others use it. Front ends send commands and watch events; none
//! of them drives. The crate `session` carries out a single run without it.

mod caller;
mod daemon;
mod error;
mod event;
mod hand;
pub mod http;
mod lock;
mod queue;
mod rebuild;
mod refusal;
mod service;
mod shared;
mod store;
mod view;

pub use api::{
    Action, Activity, ArmView, Event, FaultCode, FaultView, Job, JobId, JobState, LeftOutView, LightView,
    PlanView, Progress, ReadingView, RigView, RunView, SweepView, What,
};
pub use caller::{Caller, Submission};
pub use daemon::{Daemon, Settings};
pub use error::DaemonError;
pub use event::Events;
pub use rebuild::rebuild;
pub use refusal::{Refusal, RefusalKind};
pub use service::{command, main};
pub use store::{Sqlite, Store, StoreError};

use session::RunRequest as Order;

/// The states of a job and what changes them.
mod state {
    pub(crate) use api::Cause;
}

/// How the rig is opened.
mod station {
    pub(crate) use session::OpenRig as Station;
}

/// How a run is carried out.
mod run {
    pub(crate) use session::{
        extension_planner as ask, prepare_output as prepare, run_directory_name as name,
    };
}
