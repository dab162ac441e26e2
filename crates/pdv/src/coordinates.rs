use std::f64::consts::{FRAC_PI_2, PI};

use brdf::Spherical;
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// How far beyond the rim of the disk rounding may carry a projected direction.
const RIM: f64 = 1.0 + 4.0 * f64::EPSILON;

/// A pair of directions of an isotropic BRDF in Projected Deviation Vector coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pdv {
    /// Zenith angle of the viewer and so of its mirror direction, rad, 0 … π/2.
    pub theta_r: f64,
    /// Length of the deviation from the mirror direction on the projected disk, 0 … 2.
    pub d_p: f64,
    /// Azimuth of the deviation, rad, −π … π; 0 points from the mirror direction across the normal.
    pub phi_p: f64,
}

impl Pdv {
    /// The coordinates of a pair of directions given by angles (Algorithm 1 of the paper).
    ///
    /// `None` where a zenith angle is outside 0 … π/2 or a number is not finite.
    pub fn from_angles(incident: Spherical, exitant: Spherical) -> Option<Self> {
        let upper = 0.0..=FRAC_PI_2;
        if !(upper.contains(&incident.theta) && upper.contains(&exitant.theta)) {
            return None;
        }
        let light = DVec2::from_angle(incident.phi - exitant.phi) * incident.theta.sin();
        let deviation = light + DVec2::X * exitant.theta.sin();
        Self::from_deviation(exitant.theta, deviation)
    }

    /// The coordinates of two unit vectors, ω_i to the light and ω_o to the viewer.
    ///
    /// `None` where either lies below the horizon or is not finite. Viewed along the normal, the azimuth of the
    /// viewer is taken as 0.
    pub fn from_directions(incident: DVec3, exitant: DVec3) -> Option<Self> {
        if !(incident.z >= 0.0 && exitant.z >= 0.0) {
            return None;
        }
        let sin_o = exitant.x.hypot(exitant.y);
        let view = if sin_o > 0.0 {
            exitant.truncate() / sin_o
        } else {
            DVec2::X
        };
        let light = DVec2::new(view.dot(incident.truncate()), view.perp_dot(incident.truncate()));
        Self::from_deviation(sin_o.atan2(exitant.z), light + DVec2::X * sin_o)
    }

    fn from_deviation(theta_r: f64, deviation: DVec2) -> Option<Self> {
        (theta_r.is_finite() && deviation.is_finite()).then(|| Self {
            theta_r,
            d_p: deviation.x.hypot(deviation.y),
            phi_p: deviation.y.atan2(deviation.x),
        })
    }

    /// The coordinates in the plane of the arms by the signed deviation: positive towards the normal (φ_p = 0),
    /// negative outwards (φ_p = π).
    pub fn in_plane(theta_r: f64, deviation: f64) -> Self {
        Self {
            theta_r,
            d_p: deviation.abs(),
            phi_p: if deviation < 0.0 { PI } else { 0.0 },
        }
    }

    /// Where the light stands on the projected disk, with the viewer at azimuth 0; `None` off the disk.
    fn light(self) -> Option<DVec2> {
        if !(0.0..=FRAC_PI_2).contains(&self.theta_r) || self.d_p.is_nan() || self.d_p < 0.0 {
            return None;
        }
        let (sin_p, cos_p) = self.phi_p.sin_cos();
        let light = DVec2::new(self.d_p * cos_p - self.theta_r.sin(), self.d_p * sin_p);
        let length = light.x.hypot(light.y);
        // Rounding may put a light that stands at the rim just beyond it.
        (length <= RIM).then(|| if length > 1.0 { light / length } else { light })
    }

    /// Incident and exitant direction by angles, the viewer at azimuth 0 (Algorithm 2 of the paper); `None` where
    /// the paper returns null: the deviation leads beyond the rim of the disk, or θ_r beyond the horizon.
    ///
    /// The paper divides by cos φ_i, which is 0 at φ_i = ±90°; sin θ_i = |L_p| needs no division. θ_i is conditioned
    /// like 1/cos θ_i: at the rim half the digits are lost, and going back regains them.
    pub fn angles(self) -> Option<(Spherical, Spherical)> {
        let light = self.light()?;
        let sin = light.x.hypot(light.y);
        let incident = Spherical {
            theta: sin.atan2(cos_from_sin(sin)),
            phi: light.y.atan2(light.x),
        };
        Some((
            incident,
            Spherical {
                theta: self.theta_r,
                phi: 0.0,
            },
        ))
    }

    /// Incident and exitant unit vectors, the viewer at azimuth 0; `None` as in [`Pdv::angles`].
    pub fn directions(self) -> Option<(DVec3, DVec3)> {
        let light = self.light()?;
        let (sin_o, cos_o) = self.theta_r.sin_cos();
        // sin 90° is 1 and cos 90° is 6e-17 in f64, never negative.
        Some((
            light.extend(cos_from_sin(light.x.hypot(light.y))),
            DVec3::new(sin_o, 0.0, cos_o),
        ))
    }
}

/// √(1 − s²) without cancellation, for 0 ≤ s ≤ 1.
fn cos_from_sin(sin: f64) -> f64 {
    ((1.0 - sin) * (1.0 + sin)).max(0.0).sqrt()
}

/// Signed angle of the light from the normal, rad, at a signed deviation with the viewer at +θ_r in the same plane;
/// `None` where no light can stand.
pub fn light_angle(theta_r: f64, deviation: f64) -> Option<f64> {
    let sin = deviation - theta_r.sin();
    (sin.abs() <= RIM).then(|| sin.atan2(cos_from_sin(sin.abs())))
}
