//! Importance sampling and the directional albedo, against quadrature and by chi-square.

use std::f64::consts::TAU;

use brdf::{Brdf, Fitted, Spherical};
use glam::DVec3;
use pdv::{Distribution, Model, Observation, Planes, Sampler, Separable, albedo, spread};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEED: u64 = 7;
/// Bins of the chi-square test over the rings and along them.
const BINS: [usize; 2] = [16, 8];

fn plane(brdf: &dyn Brdf, deg: f64) -> Vec<Observation> {
    let theta_r = deg.to_radians();
    let range = theta_r.sin() - 0.996..=theta_r.sin() + 0.996;
    let spread = spread(Distribution::Lobe, theta_r, &[range], 60, 1.5e-3);
    let read = |&d: &f64| Observation::of(brdf, theta_r, d);
    spread.deviations.iter().filter_map(read).collect()
}

fn models(name: &str) -> [Box<dyn Model>; 2] {
    let material = Fitted::named(name).expect("a fitted material");
    let arc: Vec<_> = (1..30)
        .filter_map(|n| Observation::of(&material, f64::from(n) * 0.05, 0.0))
        .collect();
    let planes = [20.0, 45.0, 70.0].map(|deg| plane(&material, deg));
    [
        Box::new(Separable::from_observations(&planes[2], &arc).expect("there are readings")),
        Box::new(Planes::from_observations(&planes, &arc).expect("there are readings")),
    ]
}

fn view(theta: f64) -> DVec3 {
    Spherical { theta, phi: 0.7 }.direction()
}

/// d_p on the scale of the rings, 0 … 1, and the place along the arc of a light, 0 … 1.
fn place(incident: DVec3, exitant: DVec3) -> [f64; 2] {
    let sin = exitant.truncate().length();
    let deviation = (incident + exitant).truncate();
    let along = exitant.truncate() / sin;
    let d = deviation.length();
    let phi = along.perp_dot(deviation).atan2(along.dot(deviation));
    [(d / (1.0 + sin)).powf(0.25), phi / arc(d, sin) + 0.5]
}

/// The arc of the circle of radius d about the mirror direction that lies on the disk.
fn arc(d: f64, sin: f64) -> f64 {
    if d <= 1.0 - sin {
        TAU
    } else {
        2.0 * ((d * d + sin * sin - 1.0) / (2.0 * d * sin))
            .clamp(-1.0, 1.0)
            .acos()
    }
}

#[test]
fn what_is_drawn_has_the_density_that_is_told() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    for model in models("gold-paint") {
        let sampler = Sampler::new(model.as_ref());
        for theta in [0.1, 0.8, 1.35] {
            let (exitant, drawn) = (view(theta), 40_000);
            let mut counts = [0_u32; BINS[0] * BINS[1]];
            for _ in 0..drawn {
                let sample = sampler.sample(exitant, [rng.random(), rng.random()]).unwrap();
                assert!((sample.incident.length() - 1.0).abs() < 1e-9 && sample.incident.z >= 0.0);
                let told = sampler.pdf(sample.incident, exitant);
                // A light at the edge of a ring may be told from the next, and one at the rim has lost its digits.
                let near = sample.incident.z > 1e-3 && told > 0.0;
                if near && (place(sample.incident, exitant)[0] * 128.0).fract() > 1e-6 {
                    assert!(
                        (told / sample.pdf - 1.0).abs() < 1e-5,
                        "{told}, drawn with {}",
                        sample.pdf
                    );
                }
                let [ring, along] = place(sample.incident, exitant);
                let bin = |share: f64, bins: usize| ((share * bins as f64) as usize).min(bins - 1);
                counts[bin(ring, BINS[0]) * BINS[1] + bin(along, BINS[1])] += 1;
            }
            let expected = expected(&sampler, exitant);
            let whole: f64 = expected.iter().sum();
            assert!(
                (whole - 1.0).abs() < 2e-3,
                "the density integrates to {whole} at {theta}"
            );
            let (mut chi, mut freedom) = (0.0_f64, -1.0_f64);
            for (count, share) in counts.iter().zip(&expected) {
                let mean = share * f64::from(drawn);
                if mean > 5.0 {
                    chi += (f64::from(*count) - mean).powi(2) / mean;
                    freedom += 1.0;
                }
            }
            // 99.9 % of draws stay below by Wilson and Hilferty.
            let limit =
                freedom * (1.0 - 2.0 / (9.0 * freedom) + 3.09 * (2.0 / (9.0 * freedom)).sqrt()).powi(3);
            assert!(
                chi < limit,
                "chi² {chi} of {freedom}, at most {limit}, at {theta} with seed {SEED}"
            );
        }
    }
}

/// The share of each bin by quadrature of the density over the projected disk.
fn expected(sampler: &Sampler, exitant: DVec3) -> Vec<f64> {
    let sin = exitant.truncate().length();
    let along = exitant.truncate() / sin;
    let steps = 256;
    let mut shares = Vec::new();
    for ring in 0..BINS[0] {
        for sector in 0..BINS[1] {
            let mut sum = 0.0;
            for step in 0..steps {
                let u = (ring as f64 + (f64::from(step) + 0.5) / f64::from(steps)) / BINS[0] as f64;
                let d = (1.0 + sin) * u.powi(4);
                let width = 4.0 * (1.0 + sin) * u.powi(3) / (BINS[0] * steps as usize) as f64;
                let arc = arc(d, sin);
                let phi = ((sector as f64 + 0.5) / BINS[1] as f64 - 0.5) * arc;
                let (sin_p, cos_p) = phi.sin_cos();
                let light = along.rotate(glam::DVec2::new(d * cos_p - sin, d * sin_p));
                let cos_i = (1.0 - light.length_squared()).max(0.0).sqrt();
                if cos_i > 0.0 {
                    sum +=
                        sampler.pdf(light.extend(cos_i), exitant) / cos_i * d * width * arc / BINS[1] as f64;
                }
            }
            shares.push(sum);
        }
    }
    shares
}

/// f cos θ_i over the density is the albedo on average, and for a model that is constant along φ_p nearly always.
#[test]
fn the_mean_weight_is_the_albedo() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    for model in models("gold-paint") {
        let sampler = Sampler::new(model.as_ref());
        for theta in [0.1_f64, 0.8, 1.2] {
            let (exitant, drawn) = (view(theta), 20_000);
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..drawn {
                let sample = sampler.sample(exitant, [rng.random(), rng.random()]).unwrap();
                let f = model.eval(sample.incident, exitant).element_sum() / 3.0;
                let weight = f * sample.incident.z / sample.pdf.max(1e-300);
                sum += weight;
                squares += weight * weight;
            }
            let mean = sum / f64::from(drawn);
            let spread = (squares / f64::from(drawn) - mean * mean).max(0.0).sqrt();
            let azimuths = if model.phi_p_constant() { 1 } else { 64 };
            let whole = albedo(model.as_ref(), theta, azimuths).element_sum() / 3.0;
            let allowed = 4.0 * spread / f64::from(drawn).sqrt() + 2e-3 * whole;
            assert!(
                (mean - whole).abs() < allowed,
                "{mean}, not {whole}, at {theta} with seed {SEED}"
            );
            let limit = if model.phi_p_constant() { 0.2 } else { 1.0 };
            assert!(
                spread < limit * mean,
                "weights of {mean} spread by {spread} at {theta}: {}",
                model.about()
            );
        }
    }
}

/// Over the hemisphere, without the projected disk.
#[test]
fn the_albedo_is_what_quadrature_gives() {
    for model in models("blue-rubber") {
        let exitant = Spherical { theta: 0.6, phi: 0.0 }.direction();
        let (rings, spokes) = (400, 400);
        let mut sum = DVec3::ZERO;
        for ring in 0..rings {
            let theta = (f64::from(ring) + 0.5) / f64::from(rings) * std::f64::consts::FRAC_PI_2;
            for spoke in 0..spokes {
                let phi = (f64::from(spoke) + 0.5) / f64::from(spokes) * TAU;
                sum += model.eval(Spherical { theta, phi }.direction(), exitant) * theta.sin() * theta.cos();
            }
        }
        sum *= std::f64::consts::FRAC_PI_2 * TAU / f64::from(rings * spokes);
        let azimuths = if model.phi_p_constant() { 1 } else { 64 };
        let found = albedo(model.as_ref(), 0.6, azimuths);
        assert!(
            (found - sum).abs().max_element() < 2e-3 * sum.max_element(),
            "{found} instead of {sum}"
        );
    }
}

#[test]
fn a_black_model_is_drawn_like_a_diffuser() {
    let readings = plane(&brdf::Black, 30.0);
    let sampler = Sampler::new(&Planes::from_observations(&[readings], &[]).unwrap());
    let pdf = sampler.pdf(Spherical { theta: 0.5, phi: 2.0 }.direction(), view(0.4));
    assert!(
        (pdf * std::f64::consts::PI / 0.5_f64.cos() - 1.0).abs() < 0.05,
        "{pdf}"
    );
    assert_eq!(sampler.sample(DVec3::NEG_Z, [0.5; 2]), None);
    assert_eq!(sampler.pdf(DVec3::NEG_Z, DVec3::Z), 0.0);
}
