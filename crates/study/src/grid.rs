//! Error against run time: materials × plans × models on the simulated rig, beside what needs no such rig.

mod baseline;
mod document;
mod figures;
mod file;
mod front;
mod outcome;
mod pca;
mod plan;
mod row;
mod run;
mod shard;
mod summary;
mod task;
mod words;

pub use file::Grid;
pub use plan::GridPlan;
pub use row::{GridRow, Source};
pub(crate) use run::{merge, run, run_shard};
pub use shard::Shard;
