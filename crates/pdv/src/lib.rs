//! Projected Deviation Vector coordinates, the d_p sample distribution, the factors F and G, reconstruction models
//! and error metrics.
//!
//! Source: Tongbuasirilai, Unger, Kurt, "Efficient BRDF Sampling Using Projected Deviation Vector
//! Parameterization". The crate knows nothing of arms, rigs or files.

mod albedo;
mod auto;
mod bisected;
mod bivariate;
mod choice;
mod compare;
mod coordinates;
mod density;
mod error;
mod expectation;
mod factor;
mod grid;
mod lobe;
pub mod metric;
mod model;
mod observation;
mod planes;
mod quantile;
mod reads;
mod sampler;
mod scene;
mod separable;
mod shape;
mod sides;
mod spheres;
mod spread;
mod surface;
mod sweeps;
mod table;
mod within;

pub use albedo::albedo;
pub use auto::Auto;
pub use bivariate::Bivariate;
pub use compare::{Comparison, Draw, compare, compare_within};
pub use coordinates::{Pdv, light_angle};
pub use density::{Density, mean_reflectance};
pub use error::Error;
pub use expectation::{Expectation, Signs, Worth};
pub use factor::Factor;
pub use metric::{Channels, Metrics};
pub use model::{Basis, FactorTable, Model};
pub use observation::Observation;
pub use planes::Planes;
pub use reads::Reads;
pub use sampler::{Sample, Sampler};
pub use scene::{Cell, Scene};
pub use separable::Separable;
pub use shape::Shape;
pub use spread::{Distribution, Spread, spread};
pub use within::Within;
