//! Error against run time, and the paper's evaluation.
//!
//! A study file says which materials are reconstructed from which readings and how they are judged; [`run()`] gives
//! one CSV row for each material and angle, and a [`Summary`]. What is here so far needs no rig: readings are taken
//! from the BRDF itself.

mod error;
mod file;
mod row;
mod run;
mod study;
mod summary;

pub use error::Error;
pub use row::Row;
pub use run::{main_like, run};
pub use study::{Material, Plane, Study, VirtualArc};
pub use summary::{Angle, Summary};
