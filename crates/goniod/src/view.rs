//! What is told of rig, faults, runs and plans.

mod fault;
mod plan;
mod reading;
mod rig;
mod run;

pub use self::rig::{Activity, ArmView, Progress, RigView};
pub use fault::{FaultCode, FaultView};
pub use plan::{LeftOutView, LightView, PlanView, SweepView};
pub use reading::ReadingView;
pub use run::RunView;
