//! A job file becomes a checked and timed plan, as data.
//!
//! Pure: text and mechanics go in, a [`Plan`] comes out. Listing it, timing it and drawing it are functions of it;
//! nothing here moves an arm, reads a clock or knows of devices.

mod job;
mod plan;

pub use job::{Arc, Distribution, Job, Model, Plane};
pub use plan::{LeftOut, Mechanics, Plan, Step, Sweep};
