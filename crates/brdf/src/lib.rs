//! Directions, BRDFs, the MERL table and file formats.
//!
//! Directions are unit vectors in the specimen frame (z the normal); reflectance is linear RGB in sr⁻¹, f64.
//! The crate knows nothing of PDV coordinates, of arms or of measuring.
//!
//! ```
//! use brdf::{Brdf, HalfDifference, Spherical, specimen};
//!
//! // Gold paint, lit at 30° and seen in the mirror direction and 20° beside it.
//! let gold = specimen("gold-paint")?;
//! let at = |theta: f64, phi: f64| Spherical { theta: theta.to_radians(), phi: phi.to_radians() }.direction();
//! let (light, mirror, beside) = (at(30.0, 180.0), at(30.0, 0.0), at(50.0, 0.0));
//! assert!(gold.eval(light, mirror).x > gold.eval(light, beside).x);
//!
//! // The half vector of the latter leans by half of those 20°.
//! let angles = HalfDifference::from_directions(light, beside);
//! assert!((angles.theta_h.to_degrees() - 10.0).abs() < 1e-12);
//! # Ok::<(), brdf::Error>(())
//! ```

mod direction;
mod error;
mod fitted;
mod half_difference;
mod lambert;
mod merl;
mod merl_file;
mod mirror;
mod reflectance;
mod specimen;

pub use direction::Spherical;
pub use error::Error;
pub use fitted::Fitted;
pub use half_difference::HalfDifference;
pub use lambert::{Black, Lambert};
pub use merl::MerlTable;
pub use mirror::Mirror;
pub use reflectance::Brdf;
pub use specimen::specimen;
