use std::f64::consts::PI;

use brdf::{Brdf, Spherical};
use glam::{DVec2, DVec3};

use super::TOLERANCE;
use crate::colour::luminance;
use crate::coordinates::lift;

/// Directions of each of the two draws.
const DIRECTIONS: u32 = 768;
/// Largest zenith angle of the directions that MALE and relative errors are judged by, rad: 80°.
const JUDGED_RAD: f64 = 80.0 * PI / 180.0;
/// Floor of relative errors, sr⁻¹.
const FLOOR: f64 = 1e-3;

/// What a file loses for light at one zenith angle, in units of what is allowed: of MALE and of relative errors over
/// directions below 80°, and of the reflected light about the mirror direction.
pub(crate) fn loss(brdf: &dyn Brdf, file: &dyn Brdf, theta_i: f64) -> f64 {
    let direction = |theta: f64, phi: f64| Spherical { theta, phi }.direction();
    let incident = lift(direction(theta_i, 0.0));
    let both = |exitant: DVec3| (brdf.eval(incident, exitant), file.eval(incident, exitant));
    // The additive recurrence of the plastic number in two dimensions.
    let places = (0..DIRECTIONS).map(|n| {
        [0.754_877_666_246_692_8, 0.569_840_290_998_053_3].map(|step| (0.5 + step * f64::from(n)).fract())
    });

    let mut judged = 0.0;
    if theta_i < JUDGED_RAD {
        for [a, b] in places.clone() {
            let (f, g) = both(direction(a * JUDGED_RAD, b * PI));
            let ratio = (DVec3::ONE + g * incident.z) / (DVec3::ONE + f * incident.z);
            let male = ratio.to_array().map(|ratio| ratio.ln().abs()).iter().sum::<f64>() / 3.0;
            let relative = ((g - f).abs() / f.max(DVec3::splat(FLOOR)))
                .min(DVec3::ONE)
                .element_sum()
                / 3.0;
            // The mean of relative errors is a third of their 95th percentile where they are spread as usual.
            judged += male / TOLERANCE.male + relative / (TOLERANCE.p95 / 3.0);
        }
    }

    let (mut light, mut lost) = (0.0, 0.0);
    let mirror = DVec2::new(-incident.x, -incident.y);
    for [a, b] in places {
        // On the disk onto which directions project, in rings that are dense about the mirror direction.
        let distance = 2.0 * a.powi(4);
        let place = mirror + DVec2::from_angle(b * PI) * distance;
        let z_squared = 1.0 - place.length_squared();
        if z_squared > 0.0 {
            let (f, g) = both(place.extend(z_squared.sqrt()));
            let area = distance * a.powi(3);
            light += luminance(f) * area;
            lost += luminance(g - f).abs() * area;
        }
    }
    judged / f64::from(DIRECTIONS) + lost / light.max(f64::MIN_POSITIVE) / (2.0 * TOLERANCE.albedo)
}
