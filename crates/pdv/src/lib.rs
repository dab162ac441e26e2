//! Projected Deviation Vector coordinates, the d_p sample distribution, the factors F and G, reconstruction models
//! and error metrics.
//!
//! Source: Tongbuasirilai, Unger, Kurt, "Efficient BRDF Sampling Using Projected Deviation Vector
//! Parameterization". The crate knows nothing of arms, rigs or files.
//!
//! ```
//! use brdf::{Brdf, Fitted, Spherical};
//! use pdv::{Distribution, Draw, Observation, Planes, compare, spread};
//!
//! // Three planes of fourteen readings and an arc of six, as a perfect instrument reads them.
//! let gold = Fitted::named("gold-paint").expect("one of the fitted materials");
//! let plane = |deg: f64| -> Vec<Observation> {
//!     let theta_r = deg.to_radians();
//!     let reach = theta_r.sin() - 85_f64.to_radians().sin()..=theta_r.sin() + 85_f64.to_radians().sin();
//!     let spread = spread(Distribution::Lobe, theta_r, &[reach], 14, 1.5e-3);
//!     spread.deviations.iter().filter_map(|&d| Observation::of(&gold, theta_r, d)).collect()
//! };
//! let arc: Vec<_> = (0..6)
//!     .filter_map(|n| Observation::of(&gold, (2.5 + 16.5 * f64::from(n)).to_radians(), 0.0))
//!     .collect();
//!
//! // A model of these 48 readings, out of the plane too, and how far it is from the material.
//! let model = Planes::from_observations(&[plane(20.0), plane(45.0), plane(70.0)], &arc)?;
//! let at = |theta: f64, phi: f64| Spherical { theta, phi }.direction();
//! println!("{} sr⁻¹", model.eval(at(0.5, 2.0), at(0.9, 0.0)));
//! let draw = Draw { pairs: 10_000, ..Draw::default() };
//! assert!(compare(&gold, &[&model], &draw)[0].overall.male.unwrap() < 0.001);
//! # Ok::<(), pdv::Error>(())
//! ```

mod albedo;
mod alternatives;
mod auto;
mod bisected;
mod bivariate;
mod centre;
mod choice;
mod compare;
mod coordinates;
mod corrected;
mod course;
mod density;
mod error;
mod expectation;
mod factor;
mod grid;
mod in_plane;
mod lanes;
mod lobe;
pub mod metric;
mod model;
mod observation;
mod placement;
mod plain_table;
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
pub use alternatives::Alternatives;
pub use auto::Auto;
pub use bivariate::Bivariate;
pub use centre::{Centre, Centres, Crossing, NarrowLobe, centres};
pub use compare::{Comparison, Draw, compare, compare_within};
pub use coordinates::{Pdv, light_angle};
pub use corrected::{Check, Corrected};
pub use density::{Density, mean_reflectance};
pub use error::Error;
pub use expectation::{Expectation, Signs, Worth};
pub use factor::Factor;
pub use in_plane::InPlane;
pub use metric::{Channels, Metrics};
pub use model::{Basis, FactorTable, Model};
pub use observation::Observation;
pub use placement::{Placement, WedgeReading};
pub use plain_table::PlainTable;
pub use planes::Planes;
pub use reads::Reads;
pub use sampler::{Rings, Sample, Sampler};
pub use scene::{Cell, Scene};
pub use separable::Separable;
pub use shape::Shape;
pub use spread::{Distribution, Spread, spread};
pub use within::Within;
