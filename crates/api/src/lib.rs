//! What goes over HTTP between the daemon and its clients, typed both ways, and the client that speaks it.
//!
//! Both sides read and write the same types: [`Job`] with its [`JobState`], [`RigView`], [`RunView`], [`PlanView`],
//! [`ReadingView`] and the [`Event`]s of a stream. The feature `client` adds the blocking client; the feature `openapi`
//! lets the types describe themselves in the daemon's OpenAPI document. This crate knows no rig, no store and no server.

mod acknowledgement;
#[cfg(feature = "client")]
pub mod client;
mod event;
mod export;
mod fault;
mod job;
mod jog;
mod plan;
mod reading;
mod record;
mod rig;
mod run;
mod state;
mod verdict;

pub use acknowledgement::Acknowledgement;
#[cfg(feature = "client")]
pub use client::{Client, ClientError};
pub use event::{Event, What};
pub use export::ExportView;
pub use fault::{FaultCode, FaultId, FaultView};
pub use job::{Action, Job, JobId};
pub use jog::{ArmName, Jog};
pub use plan::{LeftOutView, LightView, PlanView, SweepView};
pub use reading::ReadingView;
pub use record::{RecordEdit, RecordView};
pub use rig::{Activity, ArmView, Progress, RigView};
pub use run::RunView;
pub use state::{Cause, JobState};
pub use verdict::VerdictView;
