//! Three numbers for a pair of directions of an isotropic BRDF, in the ways that formats have them.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use brdf::{Brdf, HalfDifference, Spherical};
use glam::DVec3;

/// Cosine of the largest zenith angle at which a BRDF is asked, 89.9°: at the horizon itself it is zero by definition.
const GRAZING: f64 = 0.001_745_328_365_898_309;

/// One way to name a pair of directions by three angles in rad.
#[derive(Clone, Copy)]
pub(crate) struct Coordinates {
    /// The angles of incident and exitant direction.
    pub(crate) of: fn(DVec3, DVec3) -> [f64; 3],
    /// Incident and exitant direction; either may lie below the horizon.
    pub(crate) directions: fn([f64; 3]) -> (DVec3, DVec3),
    /// Lower and upper end of each angle.
    pub(crate) range: [[f64; 2]; 3],
    /// The axis along which a lobe falls off, if there is one: its lower end is the mirror direction.
    pub(crate) across: Option<usize>,
    /// Angles near the mirror direction where one axis has a given angle; the two numbers, 0 … 1, spread them.
    pub(crate) near_mirror: fn(usize, f64, [f64; 2]) -> [f64; 3],
}

/// How far from the mirror direction a lobe is looked at, rad; nearer places are more often.
const LOBE_RAD: f64 = 0.6;

/// θ_i, θ_r and the azimuth between them: π on the mirror side, the other half of the circle being the same.
pub(crate) const ANGLES: Coordinates = Coordinates {
    of: |incident, exitant| {
        let (i, r) = (
            Spherical::from_direction(incident),
            Spherical::from_direction(exitant),
        );
        [i.theta, r.theta, folded(r.phi - i.phi)]
    },
    directions: |[theta_i, theta_r, phi]| {
        let incident = Spherical {
            theta: theta_i,
            phi: 0.0,
        };
        let exitant = Spherical { theta: theta_r, phi };
        (incident.direction(), exitant.direction())
    },
    range: [[0.0, FRAC_PI_2], [0.0, FRAC_PI_2], [0.0, PI]],
    across: None,
    near_mirror: |axis, angle, [a, b]| {
        let signed = 2.0 * a - 1.0;
        let off = LOBE_RAD * signed * signed * signed;
        match axis {
            0 => [
                angle,
                (angle + off).clamp(0.0, FRAC_PI_2),
                PI - LOBE_RAD * b * b * b,
            ],
            1 => [
                (angle + off).clamp(0.0, FRAC_PI_2),
                angle,
                PI - LOBE_RAD * b * b * b,
            ],
            _ => [b * FRAC_PI_2, (b * FRAC_PI_2 + off).clamp(0.0, FRAC_PI_2), angle],
        }
    },
};

/// θ_h, θ_d and φ_d of half and difference vector: φ_d in 0 … π, as the mirror symmetry of an isotropic specimen allows.
pub(crate) const HALF_DIFFERENCE: Coordinates = Coordinates {
    of: |incident, exitant| {
        let angles = HalfDifference::from_directions(incident, exitant);
        [angles.theta_h, angles.theta_d, folded(angles.phi_d)]
    },
    directions: |[theta_h, theta_d, phi_d]| {
        HalfDifference {
            theta_h,
            theta_d,
            phi_d,
        }
        .directions()
    },
    range: [[0.0, FRAC_PI_2], [0.0, FRAC_PI_2], [0.0, PI]],
    across: Some(0),
    near_mirror: |axis, angle, [a, b]| match axis {
        0 => [angle, a * FRAC_PI_2, b * PI],
        1 => [LOBE_RAD * a * a * a, angle, b * PI],
        _ => [LOBE_RAD * a * a * a, b * FRAC_PI_2, angle],
    },
};

/// The same of a specimen that may be lit and viewed the other way round: φ_d in 0 … π/2.
pub(crate) const RECIPROCAL: Coordinates = Coordinates {
    of: |incident, exitant| {
        let [theta_h, theta_d, phi_d] = (HALF_DIFFERENCE.of)(incident, exitant);
        [theta_h, theta_d, phi_d.min(PI - phi_d)]
    },
    range: [[0.0, FRAC_PI_2], [0.0, FRAC_PI_2], [0.0, FRAC_PI_2]],
    near_mirror: |axis, angle, [a, b]| {
        (HALF_DIFFERENCE.near_mirror)(axis, angle, [a, if axis == 2 { b } else { 0.5 * b }])
    },
    ..HALF_DIFFERENCE
};

/// Whether a BRDF may be lit and viewed the other way round, as far as some thousand pairs of directions tell.
pub(crate) fn is_reciprocal(brdf: &dyn Brdf) -> bool {
    let angles = |n: u32| f64::from(n) * 7.9_f64.to_radians() + 0.01;
    (0..11).all(|i| {
        (0..i).all(|r| {
            (0..13).all(|turn| {
                let incident = Spherical {
                    theta: angles(i),
                    phi: f64::from(turn) * PI / 12.0,
                };
                let exitant = Spherical {
                    theta: angles(r),
                    phi: 0.0,
                };
                let (incident, exitant) = (incident.direction(), exitant.direction());
                let (there, back) = (brdf.eval(incident, exitant), brdf.eval(exitant, incident));
                (there - back).abs().max_element() <= 1e-4 * there.max_element().max(1e-3)
            })
        })
    })
}

/// θ of the mirror direction, azimuth and distance of the exitant direction from it: azimuth 0 towards the normal, π away
/// from it, the other half of the circle being the same.
pub(crate) const MIRROR: Coordinates = Coordinates {
    of: |incident, exitant| {
        let sin_i = incident.x.hypot(incident.y);
        let across = if sin_i > 0.0 {
            DVec3::new(-incident.x / sin_i, -incident.y / sin_i, 0.0)
        } else {
            DVec3::X
        };
        let mirror = across * sin_i + DVec3::Z * incident.z;
        // Perpendicular to the mirror direction, in the plane of incidence, towards the normal.
        let up = DVec3::Z * sin_i - across * incident.z;
        let side = mirror.cross(up);
        let (u, s, m) = (exitant.dot(up), exitant.dot(side), exitant.dot(mirror));
        [sin_i.atan2(incident.z), folded(s.atan2(u)), u.hypot(s).atan2(m)]
    },
    directions: |[theta, azimuth, radial]| {
        let (sin, cos) = theta.sin_cos();
        let mirror = DVec3::new(sin, 0.0, cos);
        let up = DVec3::new(-cos, 0.0, sin);
        let (sin_r, cos_r) = radial.sin_cos();
        let exitant = mirror * cos_r + (up * azimuth.cos() + mirror.cross(up) * azimuth.sin()) * sin_r;
        (DVec3::new(-sin, 0.0, cos), exitant)
    },
    range: [[0.0, FRAC_PI_2], [0.0, PI], [0.0, PI]],
    across: Some(2),
    near_mirror: |axis, angle, [a, b]| match axis {
        0 => [angle, b * PI, LOBE_RAD * a * a * a],
        1 => [b * FRAC_PI_2, angle, LOBE_RAD * a * a * a],
        _ => [a * FRAC_PI_2, b * PI, angle],
    },
};

/// An azimuth as 0 … π, where φ and −φ are the same.
pub(crate) fn folded(phi: f64) -> f64 {
    let phi = phi.rem_euclid(TAU);
    phi.min(TAU - phi)
}

/// Reflectance of a pair of which either direction may be at or below the horizon: it is lifted to just above it, so that
/// a table goes on smoothly there.
pub(crate) fn lifted(brdf: &dyn Brdf, incident: DVec3, exitant: DVec3) -> DVec3 {
    brdf.eval(lift(incident), lift(exitant))
}

/// A unit vector lifted to a zenith angle of 89.9° where it is lower.
pub(crate) fn lift(direction: DVec3) -> DVec3 {
    if direction.z >= GRAZING {
        return direction;
    }
    let across = direction.x.hypot(direction.y);
    let sin = (1.0 - GRAZING * GRAZING).sqrt();
    if across > 0.0 {
        DVec3::new(direction.x / across * sin, direction.y / across * sin, GRAZING)
    } else {
        DVec3::new(sin, 0.0, GRAZING)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Zenith angles and the angle between the directions are all that an isotropic BRDF depends on.
        #[test]
        fn prop_each_way_names_the_same_pair(
            theta in (0.0..FRAC_PI_2, 0.0..FRAC_PI_2),
            phi in (-PI..PI, -PI..PI),
        ) {
            let i = Spherical { theta: theta.0, phi: phi.0 }.direction();
            let r = Spherical { theta: theta.1, phi: phi.1 }.direction();
            for way in [ANGLES, HALF_DIFFERENCE, RECIPROCAL, MIRROR] {
                let angles = (way.of)(i, r);
                for (angle, [low, high]) in angles.iter().zip(way.range) {
                    prop_assert!((low..=high).contains(angle), "{angles:?}");
                }
                let (i_back, r_back) = (way.directions)(angles);
                prop_assert!((i_back.dot(r_back) - i.dot(r)).abs() < 1e-12);
                let there = [i.z, r.z];
                let swapped = (i_back.z - there[1]).abs() < 1e-7 && (r_back.z - there[0]).abs() < 1e-7;
                let same = (i_back.z - there[0]).abs() < 1e-7 && (r_back.z - there[1]).abs() < 1e-7;
                prop_assert!(same || swapped, "{i_back} {r_back} instead of {i} {r}");
            }
        }
    }

    #[test]
    fn azimuth_0_about_the_mirror_direction_leads_to_the_normal() {
        let incident = Spherical { theta: 0.5, phi: PI }.direction();
        let [theta, azimuth, radial] = (MIRROR.of)(incident, DVec3::Z);
        assert!((theta - 0.5).abs() < 1e-15 && azimuth.abs() < 1e-12 && (radial - 0.5).abs() < 1e-15);
    }
}
