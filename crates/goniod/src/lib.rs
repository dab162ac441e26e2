//! The capture daemon as a library: a queue of jobs that loses nothing, and the rig that works it off.
//!
//! [`Daemon`] is the service: it keeps jobs, runs and readings in a [`Store`], carries one job after the other
//! through, and obeys an operator at once; [`http`] lets others use it. Front ends send commands and watch events; none
//! of them drives. The crate `session` carries out a single run without it.

mod audit;
mod caller;
mod daemon;
mod error;
mod event;
mod history;
pub mod http;
mod lock;
mod notify;
mod operator;
mod queue;
mod rebuild;
mod refusal;
mod remedy;
mod service;
mod shared;
mod store;
mod strays;
mod view;
mod worker;

pub use api::{
    Action, Activity, ArmView, Event, ExportView, FaultCode, FaultId, FaultView, Job, JobId, JobState,
    LeftOutView, LightView, PlanView, Progress, ReadingView, RecordEdit, RecordView, RigView, RunView,
    SweepView, VerdictView, What,
};
pub use caller::{Caller, Submission};
pub use daemon::{Daemon, Settings};
pub use error::DaemonError;
pub use event::Events;
pub use history::RunQuery;
pub use notify::{Message, NotifyError, Occasion, Webhook};
pub use rebuild::rebuild;
pub use refusal::{Refusal, RefusalKind};
pub use service::{command, main};
pub use session::{OpenRig, PortOfFile, RigSource};
pub use store::{Behaviour, Memory, Sqlite, Store, StoreError, backup, restore};
pub use worker::WorkerPlace;
