use std::f64::consts::{PI, TAU};

use brdf::Brdf;
use glam::DVec3;

use crate::Pdv;

const STEPS: usize = 4096;

/// Directional albedo of a BRDF that is constant along φ_p, for the viewer at `theta_o` (rad, 0 … π/2).
///
/// cos θ_i dω_i is area on the projected disk and PDV is polar there: a(θ_o) = ∫ ρ(θ_o, d) α(d) d dd, with α the arc
/// of the circle of radius d that lies on the disk. For another BRDF it is the albedo of its values in the plane,
/// taken towards the normal.
pub fn albedo(brdf: &(impl Brdf + ?Sized), theta_o: f64) -> DVec3 {
    let s = theta_o.sin();
    let mut sum = DVec3::ZERO;
    for step in 0..STEPS {
        // d = (1 + s) u⁴ puts the points where lobes are.
        let u = (step as f64 + 0.5) / STEPS as f64;
        let d_p = (1.0 + s) * u.powi(4);
        let width = 4.0 * (1.0 + s) * u.powi(3) / STEPS as f64;
        let pdv = Pdv {
            theta_r: theta_o,
            d_p,
            phi_p: 0.0,
        };
        if let Some((incident, exitant)) = pdv.directions() {
            sum += brdf.eval(incident, exitant) * (arc_on_disk(d_p, s) * d_p * width);
        }
    }
    sum
}

/// Angle of the arc of radius `d` about the mirror direction, at `s` from the centre, that lies on the unit disk.
fn arc_on_disk(d: f64, s: f64) -> f64 {
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
            let a = albedo(&Lambert::new(1.0).unwrap(), theta_deg.to_radians());
            assert!((a.x - 1.0).abs() < 1e-4, "{} at {theta_deg}°", a.x);
        }
    }

    #[test]
    fn no_fitted_material_reflects_more_than_it_gets() {
        // At normal view a fit is nearly constant along φ_p.
        for (name, material) in Fitted::all() {
            let a = albedo(&material, 0.0);
            assert!(a.max_element() < 1.0, "{name}: {a}");
        }
    }
}
