//! Projected Deviation Vector coordinates, the d_p sample distribution, the factors F and G, reconstruction models
//! and error metrics.
//!
//! Source: Tongbuasirilai, Unger, Kurt, "Efficient BRDF Sampling Using Projected Deviation Vector
//! Parameterization". The crate knows nothing of arms, rigs or files.

mod coordinates;
mod density;
mod spread;

pub use coordinates::{Pdv, light_angle};
pub use density::{Density, mean_reflectance};
pub use spread::{Distribution, Spread, spread};
