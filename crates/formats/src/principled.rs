use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, PI};

use brdf::{Brdf, HalfDifference, Spherical};
use glam::DVec3;

/// Smallest roughness, whose lobe a renderer still resolves.
const SMOOTHEST: f64 = 0.02;
/// Range of the index of refraction.
const IOR: [f64; 2] = [1.0, 3.0];
/// Pairs of directions to which parameters are fitted; half of them near the mirror direction.
const PAIRS: u32 = 1200;
/// How often each parameter is fitted anew; the last rounds change the fifth digit.
const ROUNDS: usize = 8;

/// The parameters that the principled models of renderers share, and the BRDF that they stand for.
///
/// The BRDF is that of the glTF 2.0 specification, appendix B: a GGX lobe of α = roughness² with the Smith masking of both
/// directions, over a metal or over a diffuser behind a Fresnel mix. The surface of OpenPBR differs from it by what
/// several reflections add, which is a few percent where it is rough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Principled {
    /// Albedo of the diffuser, or reflectance of the metal at normal incidence, linear RGB, 0 … 1.
    pub(crate) base: DVec3,
    /// 0 for a dielectric … 1 for a metal.
    pub(crate) metalness: f64,
    /// 0 … 1, the square root of GGX's α.
    pub(crate) roughness: f64,
    /// Index of refraction of the dielectric.
    pub(crate) ior: f64,
}

impl Principled {
    /// The parameters whose BRDF is nearest to another, by the squared difference of the cube roots of f cos θ_i cos θ_r, which
    /// agrees with what people see (Fores, Ferwerda, Gu 2012).
    pub(crate) fn fitted(brdf: &dyn Brdf) -> Self {
        let pairs: Vec<(DVec3, DVec3, DVec3)> = (0..PAIRS)
            .map(pair)
            .filter(|(incident, exitant)| {
                incident.z > 0.05 && exitant.z > 0.05 && brdf.valid(*incident, *exitant)
            })
            .map(|(incident, exitant)| (incident, exitant, brdf.eval(incident, exitant)))
            .collect();
        let starts = [(0.0, 0.3), (0.0, 0.7), (1.0, 0.15), (1.0, 0.5)].map(|(metalness, roughness)| Self {
            base: DVec3::splat(0.5),
            metalness,
            roughness,
            ior: 1.5,
        });
        let refined = starts.map(|start| start.refined(&pairs));
        let best = refined.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or(starts[0], |(_, parameters)| parameters)
    }

    /// Fits one parameter after the other, again and again; returns what is left with the parameters.
    fn refined(mut self, pairs: &[(DVec3, DVec3, DVec3)]) -> (f64, Self) {
        for _ in 0..ROUNDS {
            for channel in 0..3 {
                self.base[channel] = least([0.0, 1.0], |base| {
                    let mut other = self;
                    other.base[channel] = base;
                    other.distance(pairs)
                });
            }
            self.roughness = least([SMOOTHEST, 1.0], |roughness| {
                Self { roughness, ..self }.distance(pairs)
            });
            self.metalness = least([0.0, 1.0], |metalness| Self { metalness, ..self }.distance(pairs));
            self.ior = least(IOR, |ior| Self { ior, ..self }.distance(pairs));
        }
        (self.distance(pairs), self)
    }

    fn distance(&self, pairs: &[(DVec3, DVec3, DVec3)]) -> f64 {
        let distance = |&(incident, exitant, f): &(DVec3, DVec3, DVec3)| {
            let cos = incident.z * exitant.z;
            let root = |f: DVec3| (f * cos).to_array().map(f64::cbrt);
            (DVec3::from_array(root(self.eval(incident, exitant))) - DVec3::from_array(root(f)))
                .length_squared()
        };
        pairs.iter().map(distance).sum()
    }
}

impl Brdf for Principled {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return DVec3::ZERO;
        }
        let half = (incident + exitant).normalize_or(DVec3::Z);
        let alpha_squared = self.roughness.max(SMOOTHEST).powi(4);
        let sin_squared = half.x * half.x + half.y * half.y;
        // (n·h)² (α² − 1) + 1 without cancellation.
        let spread = sin_squared + alpha_squared * half.z * half.z;
        let normals = alpha_squared * FRAC_1_PI / (spread * spread);
        let mask = |cos: f64| cos + (alpha_squared + (1.0 - alpha_squared) * cos * cos).sqrt();
        let lobe = normals / (mask(incident.z) * mask(exitant.z));
        let schlick = (1.0 - incident.dot(half).clamp(0.0, 1.0)).powi(5);
        let normal_incidence = ((self.ior - 1.0) / (self.ior + 1.0)).powi(2);
        let fresnel = normal_incidence + (1.0 - normal_incidence) * schlick;
        let dielectric = (self.base * FRAC_1_PI).lerp(DVec3::splat(lobe), fresnel);
        let metal = self.base.lerp(DVec3::ONE, schlick) * lobe;
        dielectric.lerp(metal, self.metalness)
    }
}

/// The n-th pair of directions, even ones spread over all, odd ones near the mirror direction.
fn pair(n: u32) -> (DVec3, DVec3) {
    // The additive recurrence of the plastic number in three dimensions.
    const STEP: [f64; 3] = [
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_2,
        0.549_700_477_901_970_3,
    ];
    let [a, b, c] = STEP.map(|step| (0.5 + step * f64::from(n)).fract());
    if n.is_multiple_of(2) {
        let direction = |theta, phi| Spherical { theta, phi }.direction();
        return (direction(a * FRAC_PI_2, c * PI), direction(b * FRAC_PI_2, 0.0));
    }
    let pair = HalfDifference {
        theta_h: 0.5 * a * a,
        theta_d: b * FRAC_PI_2,
        phi_d: c * FRAC_PI_2,
    };
    pair.directions()
}

/// Where a function is least between two places, to 1e-5, if it has one valley there: by the golden section.
fn least([mut low, mut high]: [f64; 2], f: impl Fn(f64) -> f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let inner = |low: f64, high: f64| [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let [mut left, mut right] = inner(low, high);
    let (mut at_left, mut at_right) = (f(left), f(right));
    while high - low > 1e-5 {
        if at_left <= at_right {
            high = right;
            (right, at_right) = (left, at_left);
            left = inner(low, high)[0];
            at_left = f(left);
        } else {
            low = left;
            (left, at_left) = (right, at_right);
            right = inner(low, high)[1];
            at_right = f(right);
        }
    }
    // An end itself is never looked at by the section.
    let middle = f64::midpoint(low, high);
    [low, middle, high]
        .into_iter()
        .min_by(|&a, &b| f(a).total_cmp(&f(b)))
        .unwrap_or(middle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_made_of_parameters_is_found_again() {
        for made in [
            Principled {
                base: DVec3::new(0.8, 0.5, 0.2),
                metalness: 1.0,
                roughness: 0.4,
                ior: 1.5,
            },
            Principled {
                base: DVec3::new(0.1, 0.2, 0.6),
                metalness: 0.0,
                roughness: 0.25,
                ior: 1.5,
            },
        ] {
            let found = Principled::fitted(&made);
            assert!((found.base - made.base).abs().max_element() < 0.02, "{found:?}");
            assert!((found.roughness - made.roughness).abs() < 0.01, "{found:?}");
            assert!((found.metalness - made.metalness).abs() < 0.05, "{found:?}");
            assert!(
                made.metalness > 0.5 || (found.ior - made.ior).abs() < 0.05,
                "{found:?}"
            );
        }
    }
}
