//! Directions, BRDFs, the MERL table and file formats.
//!
//! Directions are unit vectors in the specimen frame (z the normal); reflectance is linear RGB in sr⁻¹, f64.
//! The crate knows nothing of PDV coordinates, of arms or of measuring.

mod reflectance;

pub use reflectance::Brdf;
