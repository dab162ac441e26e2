use std::f64::consts::{FRAC_PI_2, PI};

use brdf::{Brdf, HalfDifference};

use super::measured::Plane;
use crate::colour::luminance;
use crate::coordinates::lifted;

/// Nodes of D.
pub(crate) const NDF: usize = 1024;
/// Nodes of σ.
pub(crate) const SIGMA: usize = 256;

/// The distribution D of microfacet normals and the projected area σ that goes with it.
pub(crate) struct Facets {
    /// D over u, θ = u² · 90°.
    pub(crate) ndf: Vec<f64>,
    /// σ over u.
    pub(crate) sigma: Vec<f64>,
}

impl Facets {
    /// D is the shape that the lobe has over the half angle, on the average over difference angles; together with the
    /// normalisation ∫ D cos θ dω = 1 it gives σ(θ_i) = ∫ D max(0, m·ω_i) dω.
    pub(crate) fn new(brdf: &dyn Brdf) -> Self {
        let theta = |n: usize, nodes: usize| (n as f64 / (nodes - 1) as f64).powi(2) * FRAC_PI_2;
        let lobe = |theta_h: f64| {
            let at = |theta_d: f64| {
                let value = |theta_h: f64| {
                    let pair = HalfDifference {
                        theta_h,
                        theta_d,
                        phi_d: FRAC_PI_2,
                    };
                    let (incident, exitant) = pair.directions();
                    luminance(lifted(brdf, incident, exitant)).max(1e-9)
                };
                (value(theta_h) / value(0.0)).ln()
            };
            let sum: f64 = [0.0_f64, 20.0, 45.0]
                .map(|theta_d| at(theta_d.to_radians()))
                .iter()
                .sum();
            (sum / 3.0).exp().clamp(1e-9, 1e9)
        };
        let mut ndf: Vec<f64> = (0..NDF).map(|n| lobe(theta(n, NDF))).collect();
        // Rings of θ = u² π/2 about the normal, with the middle value of D.
        let rings: Vec<(f64, f64, f64)> = (0..NDF - 1)
            .map(|n| {
                let (low, high) = (theta(n, NDF), theta(n + 1, NDF));
                let middle = f64::midpoint(low, high);
                (
                    middle.sin(),
                    middle.cos(),
                    0.5 * (ndf[n] + ndf[n + 1]) * (low.cos() - high.cos()),
                )
            })
            .collect();
        let projected = |theta_i: f64| {
            let (sin_i, cos_i) = theta_i.sin_cos();
            let ring = |&(sin, cos, weight): &(f64, f64, f64)| {
                // ∫ max(0, a + b cos φ) dφ with a = cos θ cos θ_i and b = sin θ sin θ_i.
                let (a, b) = (cos * cos_i, sin * sin_i);
                let half = if a >= b {
                    PI
                } else {
                    (-a / b.max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0).acos()
                };
                2.0 * weight * (a * half + b * half.sin())
            };
            rings.iter().map(ring).sum::<f64>()
        };
        let whole = projected(0.0);
        ndf.iter_mut().for_each(|density| *density /= whole);
        let sigma = (0..SIGMA)
            .map(|n| (projected(theta(n, SIGMA)) / whole).max(1e-6))
            .collect();
        // As the file has them, so that their rounding is made good by what is divided by them.
        let single = |values: Vec<f64>| values.into_iter().map(|value| f64::from(value as f32)).collect();
        Self {
            ndf: single(ndf),
            sigma: single(sigma),
        }
    }

    /// Both as a reader has them.
    pub(crate) fn planes(&self) -> (Plane, Plane) {
        (
            Plane::of_theta(self.ndf.clone()),
            Plane::of_theta(self.sigma.clone()),
        )
    }
}
