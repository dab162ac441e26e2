//! Directions, BRDFs, the MERL table and file formats.
//!
//! Directions are unit vectors in the specimen frame (z the normal); reflectance is linear RGB in sr⁻¹, f64.
//! The crate knows nothing of PDV coordinates, of arms or of measuring.

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
