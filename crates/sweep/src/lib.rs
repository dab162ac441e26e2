//! A job file becomes a checked and timed plan, as data.
//!
//! Pure: text and mechanics go in, a [`Plan`] comes out. Listing it, timing it and drawing it are functions of it;
//! nothing here moves an arm, reads a clock or knows of devices.

mod addition;
mod cell;
mod error;
mod file;
mod first;
mod floor;
mod job;
mod leg;
mod light;
mod mechanics;
mod order;
mod pass;
mod plan;
mod planner;
mod reach;
mod route;
mod specimen;
mod targets;
mod unread;

pub use addition::{Addition, add};
pub use cell::cells;
pub use error::SweepError;
pub use file::{MAX_PLANES, THETA_R_DEG};
pub use floor::floor_s;
pub use job::{Arc, FORMATS, Job, Mode, Model, Plane, Until};
pub use leg::Leg;
pub use light::Light;
pub use mechanics::Mechanics;
pub use pdv::{Cell, Distribution, Scene};
pub use plan::{LeftOut, Plan, Step, Sweep};
pub use planner::{Visit, plan, visits};
pub use route::way;
pub use specimen::{RecordFlaw, Specimen, line};
