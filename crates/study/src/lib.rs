//! Error against run time, and the paper's evaluation.
//!
//! A study file says what is measured, how, and how it is judged. There are two kinds: a [`Grid`] captures materials
//! on the simulated rig under a paused clock, with every plan and every model, and sets the error beside the seconds
//! that the rig took; an [`Evaluation`] is the paper's, whose readings are taken from the BRDF itself. Both write into
//! a directory: rows as CSV, plots, a page. A [`Campaign`] is no study of error: it lets things go wrong, thousands of
//! times, and tells when what came of it was not true or not safe.

mod campaign;
mod check;
mod error;
mod family;
mod figure;
mod grid;
mod judge;
mod ledger;
mod material;
mod measure;
mod page;
mod paper;
mod specimen_file;
mod statistics;
mod study;
mod write;

pub use campaign::{Campaign, Campaigned, Carried, Script, WireFault, Wrong};
pub use error::Error;
pub use grid::{Grid, GridPlan, GridRow, Shard, Source};
pub use judge::Score;
pub use material::Material;
pub use measure::{Capture, Measured, measure};
pub use paper::{Angle, Evaluation, Nodes, Row, Summary};
pub use study::{Kind, Progress, Study};

pub(crate) use study::read;
