use std::f64::consts::{FRAC_PI_4, PI};

use glam::DVec3;

use crate::{Brdf, Error};

/// A mirror as an instrument of finite aperture sees it.
///
/// With the half-angle κ and Ω = π sin² κ, f = ρ / (Ω √(cos θ_i cos θ_o)) where ω_i lies within κ of the mirror
/// direction of ω_o, and 0 elsewhere: ρ/(Ω cos θ) in the mirror direction. The geometric mean keeps f reciprocal;
/// the reflected energy is ρ·(1 + κ²/8 − (κ tan θ)²/32) to the second order in κ, as long as the cone stays above the
/// horizon: within 1e-5 of ρ at 0.5° and θ up to 60°.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirror {
    /// ρ/Ω, sr⁻¹.
    peak: f64,
    /// Square of the chord that belongs to κ.
    reach_squared: f64,
}

impl Mirror {
    /// Half-angle of the usual aperture, rad: 0.5°, and so at most 4180 sr⁻¹ at normal incidence.
    pub const HALF_ANGLE_RAD: f64 = 0.5 * PI / 180.0;

    /// A mirror of reflectance `reflectance` (0 … 1) seen within `half_angle_rad` (above 0, up to π/4).
    ///
    /// # Errors
    /// A parameter is outside its range.
    ///
    /// ```
    /// use brdf::{Brdf, Mirror};
    /// use glam::DVec3;
    ///
    /// let mirror = Mirror::new(0.9, Mirror::HALF_ANGLE_RAD)?;
    /// let solid_angle_sr = std::f64::consts::PI * Mirror::HALF_ANGLE_RAD.sin().powi(2);
    /// assert!((mirror.eval(DVec3::Z, DVec3::Z).x * solid_angle_sr / 0.9 - 1.0).abs() < 1e-12);
    /// # Ok::<(), brdf::Error>(())
    /// ```
    pub fn new(reflectance: f64, half_angle_rad: f64) -> Result<Self, Error> {
        if !(0.0..=1.0).contains(&reflectance) {
            return Err(Error::Parameter {
                what: "reflectance of a mirror",
                value: reflectance,
                allowed: "0 … 1",
            });
        }
        if !(1e-6..=FRAC_PI_4).contains(&half_angle_rad) {
            return Err(Error::Parameter {
                what: "half-angle of a mirror's aperture in rad",
                value: half_angle_rad,
                allowed: "1e-6 … π/4",
            });
        }
        Ok(Self {
            peak: reflectance / (PI * half_angle_rad.sin().powi(2)),
            reach_squared: (2.0 * (half_angle_rad / 2.0).sin()).powi(2),
        })
    }
}

impl Brdf for Mirror {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return DVec3::ZERO;
        }
        let mirrored = DVec3::new(-exitant.x, -exitant.y, exitant.z);
        if incident.distance_squared(mirrored) > self.reach_squared {
            return DVec3::ZERO;
        }
        DVec3::splat(self.peak / (incident.z * exitant.z).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Spherical;

    #[test]
    fn reads_rho_over_omega_cos_theta_in_the_mirror_direction() {
        let mirror = Mirror::new(0.9, Mirror::HALF_ANGLE_RAD).unwrap();
        for theta in [0.0_f64, 0.5, 1.2] {
            let incident = Spherical { theta, phi: PI }.direction();
            let exitant = Spherical { theta, phi: 0.0 }.direction();
            let omega = PI * Mirror::HALF_ANGLE_RAD.sin().powi(2);
            let expected = 0.9 / (omega * theta.cos());
            assert!(
                (mirror.eval(incident, exitant).x / expected - 1.0).abs() < 1e-12,
                "at {theta} rad"
            );
        }
    }

    #[test]
    fn ends_at_the_aperture() {
        let mirror = Mirror::new(1.0, 0.02).unwrap();
        let exitant = Spherical { theta: 0.6, phi: 0.0 }.direction();
        let at = |off: f64| {
            mirror
                .eval(
                    Spherical {
                        theta: 0.6 + off,
                        phi: PI,
                    }
                    .direction(),
                    exitant,
                )
                .x
        };
        assert!(at(0.0199) > 0.0 && at(-0.0199) > 0.0);
        assert_eq!((at(0.0201), at(-0.0201)), (0.0, 0.0));
    }

    #[test]
    fn reflects_rho() {
        let half_angle = 0.05_f64;
        let mirror = Mirror::new(0.7, half_angle).unwrap();
        for theta in [0.0_f64, 0.8, 1.3] {
            let exitant = Spherical { theta, phi: 0.0 }.direction();
            let axis = DVec3::new(-exitant.x, -exitant.y, exitant.z);
            let (side, up) = axis.any_orthonormal_pair();
            let n = 400;
            let mut energy = 0.0;
            for ring in 0..n {
                // Rings of equal solid angle.
                let cos = 1.0 - (1.0 - half_angle.cos()) * (f64::from(ring) + 0.5) / f64::from(n);
                let sin = (1.0 - cos * cos).sqrt();
                for spoke in 0..64 {
                    let (s, c) = (f64::from(spoke) * PI / 32.0).sin_cos();
                    let incident = axis * cos + (side * c + up * s) * sin;
                    energy += mirror.eval(incident, exitant).x * incident.z;
                }
            }
            energy *= 2.0 * PI * (1.0 - half_angle.cos()) / f64::from(n * 64);
            let second_order = half_angle.powi(2) * (1.0 / 8.0 - theta.tan().powi(2) / 32.0);
            let excess = energy / 0.7 - 1.0;
            assert!(
                (excess - second_order).abs() < 5e-5,
                "{excess} at {theta} rad, not {second_order}"
            );
        }
    }
}
