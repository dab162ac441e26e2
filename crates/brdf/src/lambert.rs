use std::f64::consts::FRAC_1_PI;

use glam::DVec3;

use crate::{Brdf, Error};

/// An ideal diffuser: ρ/π in every direction and channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lambert {
    albedo: f64,
}

impl Lambert {
    /// A diffuser that reflects the share `albedo` (0 … 1) of the light.
    ///
    /// # Errors
    /// `albedo` is outside 0 … 1.
    ///
    /// ```
    /// use brdf::{Brdf, Lambert};
    /// use glam::DVec3;
    ///
    /// let half = Lambert::new(0.5)?;
    /// assert_eq!(half.eval(DVec3::Z, DVec3::Z).x, 0.5 / std::f64::consts::PI);
    /// assert!(Lambert::new(1.1).is_err());
    /// # Ok::<(), brdf::Error>(())
    /// ```
    pub fn new(albedo: f64) -> Result<Self, Error> {
        if !(0.0..=1.0).contains(&albedo) {
            return Err(Error::Parameter {
                what: "albedo of a Lambertian specimen",
                value: albedo,
                allowed: "0 … 1",
            });
        }
        Ok(Self { albedo })
    }
}

impl Brdf for Lambert {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if incident.z > 0.0 && exitant.z > 0.0 {
            DVec3::splat(self.albedo * FRAC_1_PI)
        } else {
            DVec3::ZERO
        }
    }
}

/// A specimen that reflects nothing; the answer against which every error is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Black;

impl Brdf for Black {
    fn eval(&self, _incident: DVec3, _exitant: DVec3) -> DVec3 {
        DVec3::ZERO
    }
}
