//! The capture daemon as a library: a queue of jobs that loses nothing, and the rig that works it off.
//!
//! [`Daemon`] is the service: it keeps jobs, runs and readings in a [`Store`], carries one job after the other
//! through, and obeys an operator at once; [`http`] lets others use it. [`run()`] carries out a single order without
//! it. Front ends send commands and watch events; none of them drives.

mod calibrate;
mod certificates;
mod daemon;
mod directions;
mod error;
mod event;
mod hand;
pub mod http;
mod job;
mod lock;
mod order;
mod queue;
mod rebuild;
mod refusal;
mod run;
mod service;
mod shared;
mod state;
mod station;
mod status;
mod store;
mod view;

pub use calibrate::{Calibrated, Calibration};
pub use certificates::Certificates;
pub use daemon::{Daemon, Settings};
pub use directions::job_text;
pub use error::DaemonError;
pub use event::{Event, Events, What};
pub use job::{Action, Caller, Job, JobId, Submission};
pub use order::{Order, rig_text};
pub use rebuild::rebuild;
pub use refusal::{Refusal, RefusalKind};
pub use run::{Ended, resume, run};
pub use service::{command, main};
pub use state::JobState;
pub use status::Status;
pub use store::{Sqlite, Store, StoreError};
pub use view::{
    Activity, ArmView, FaultCode, FaultView, LeftOutView, LightView, PlanView, Progress, ReadingView,
    RigView, RunView, SweepView,
};
