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
mod summary;
mod words;

pub use file::Grid;
pub use plan::GridPlan;
pub use row::{GridRow, Source};
pub(crate) use run::run;
