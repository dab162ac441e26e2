//! The paper's own evaluation: readings are taken from the BRDF itself, without a rig.

mod compare;
mod document;
mod evaluation;
mod figures;
mod file;
mod row;
mod run;
mod spheres;
mod summary;

pub use evaluation::{Evaluation, Nodes};
pub use row::Row;
pub(crate) use run::run;
pub use summary::{Angle, Summary};
