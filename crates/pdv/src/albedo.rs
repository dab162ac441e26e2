use std::f64::consts::{PI, TAU};

use brdf::Brdf;
use glam::DVec3;

use crate::Pdv;

const STEPS: usize = 4096;

/// Directional albedo of a BRDF for the viewer at `theta_o` (rad, 0 … π/2).
///
/// cos θ_i dω_i is area on the projected disk and PDV is polar there: a(θ_o) = ∫ ρ(θ_o, d) α(d) d dd, with α the arc
/// of the circle of radius d that lies on the disk. One azimuth is exact for a BRDF that is constant along φ_p; for
/// another ρ is the mean over `azimuths` places along the arc.
///
/// ```
/// use brdf::{Lambert, Mirror};
/// use pdv::albedo;
///
/// assert!((albedo(&Lambert::new(0.5)?, 0.7, 1).x - 0.5).abs() < 1e-3);
/// let mirror = Mirror::new(0.9, Mirror::HALF_ANGLE_RAD)?;
/// assert!((albedo(&mirror, 0.5, 16).x - 0.9).abs() < 0.01);
/// # Ok::<(), brdf::Error>(())
/// ```
pub fn albedo(brdf: &(impl Brdf + ?Sized), theta_o: f64, azimuths: usize) -> DVec3 {
    let s = theta_o.sin();
    let mut sum = DVec3::ZERO;
    for step in 0..STEPS {
        let [inner, outer] = ring(step, STEPS, s);
        let d_p = (0.5 * (inner * inner + outer * outer)).sqrt();
        let arc = arc_on_disk(d_p, s);
        let area = 0.5 * (outer * outer - inner * inner) * arc;
        for n in 0..azimuths {
            let phi_p = if azimuths == 1 {
                0.0
            } else {
                ((n as f64 + 0.5) / azimuths as f64 - 0.5) * arc
            };
            let pdv = Pdv {
                theta_r: theta_o,
                d_p,
                phi_p,
            };
            if let Some((incident, exitant)) = pdv.directions() {
                sum += brdf.eval(incident, exitant) * (area / azimuths as f64);
            }
        }
    }
    sum
}

/// Inner and outer d_p of ring n of `rings` about the mirror direction, dense where lobes are: (1 + s)(n/rings)⁴.
pub(crate) fn ring(n: usize, rings: usize, s: f64) -> [f64; 2] {
    [n, n + 1].map(|n| {
        let share = n as f64 / rings as f64;
        (1.0 + s) * share * share * share * share
    })
}

/// Angle of the arc of radius `d` about the mirror direction, at `s` from the centre, that lies on the unit disk.
pub(crate) fn arc_on_disk(d: f64, s: f64) -> f64 {
    if d <= 1.0 - s {
        TAU
    } else if d < 1.0 + s {
        2.0 * ((d * d + s * s - 1.0) / (2.0 * d * s))
            .clamp(-1.0, 1.0)
            .acos()
            .min(PI)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use brdf::{Fitted, Lambert};

    #[test]
    fn a_white_diffuser_reflects_everything() {
        for theta_deg in [0.0_f64, 30.0, 60.0, 85.0] {
            let a = albedo(&Lambert::new(1.0).unwrap(), theta_deg.to_radians(), 1);
            assert!((a.x - 1.0).abs() < 1e-4, "{} at {theta_deg}°", a.x);
        }
    }

    #[test]
    fn no_fitted_material_reflects_more_than_it_gets() {
        // At normal view a fit is nearly constant along φ_p.
        for (name, material) in Fitted::all() {
            let a = albedo(&material, 0.0, 1);
            assert!(a.max_element() < 1.0, "{name}: {a}");
        }
    }
}
