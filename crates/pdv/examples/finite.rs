//! Looks for a value that is negative or no number: `cargo run --release -p pdv --example finite -- [PAIRS]`, 10⁸ pairs
//! of directions without a number, over every fitted material and every model. Every eighth pair is degenerate: at the
//! horizon, along the normal, in the mirror direction or back to where it came from.

use brdf::{Brdf, Fitted, Spherical};
use glam::DVec3;
use pdv::{Bivariate, Distribution, Error, Model, Observation, Planes, Separable, spread};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

fn models(material: &Fitted) -> Result<[Box<dyn Model>; 3], Error> {
    let plane = |deg: f64| {
        let theta_r = deg.to_radians();
        let range = theta_r.sin() - 0.996..=theta_r.sin() + 0.996;
        let spread = spread(Distribution::Lobe, theta_r, &[range], 30, 1.5e-3);
        let read = |&d: &f64| Observation::of(material, theta_r, d);
        spread.deviations.iter().filter_map(read).collect::<Vec<_>>()
    };
    let planes = [20.0, 45.0, 70.0].map(plane);
    let arc: Vec<_> = (1..30)
        .filter_map(|n| Observation::of(material, f64::from(n) * 0.05, 0.0))
        .collect();
    Ok([
        Box::new(Separable::from_observations(&planes[2], &arc)?),
        Box::new(Planes::from_observations(&planes, &arc)?),
        Box::new(Bivariate::from_observations(&planes, &arc)?),
    ])
}

fn direction(rng: &mut ChaCha8Rng) -> DVec3 {
    let theta = rng.random::<f64>() * std::f64::consts::FRAC_PI_2;
    let phi = rng.random::<f64>() * std::f64::consts::TAU;
    Spherical { theta, phi }.direction()
}

fn pair(rng: &mut ChaCha8Rng) -> (DVec3, DVec3) {
    let (incident, exitant) = (direction(rng), direction(rng));
    let mirrored = DVec3::new(-exitant.x, -exitant.y, exitant.z);
    let grazing = |of: DVec3| of.with_z(rng_tiny(of.x)).normalize();
    match rng.random_range(0..64) {
        0 => (mirrored, exitant),
        1 => (exitant, exitant),
        2 => (DVec3::Z, exitant),
        3 => (grazing(incident), exitant),
        4 => (grazing(incident), grazing(exitant)),
        5 => (grazing(mirrored), grazing(exitant)),
        6 => ((mirrored + incident * 1e-9).normalize(), exitant),
        7 => (incident.with_z(0.0).normalize(), exitant),
        _ => (incident, exitant),
    }
}

/// Some height above the horizon of 1e-300 … 1e-4, from the digits of a number.
fn rng_tiny(of: f64) -> f64 {
    10_f64.powf(-4.0 - 296.0 * (of * 1e6).fract().abs())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let pairs: f64 = std::env::args().nth(1).map_or(Ok(1e8), |arg| arg.parse())?;
    let share = (pairs / 300.0).ceil() as u64;
    let materials: Vec<_> = Fitted::all().collect();
    let bad: Vec<String> = materials
        .par_iter()
        .enumerate()
        .map(|(n, (name, material))| {
            let mut rng = ChaCha8Rng::seed_from_u64(n as u64);
            let mut bad = Vec::new();
            for model in models(material).map_err(|error| format!("{name}: {error}"))? {
                for _ in 0..share {
                    let (incident, exitant) = pair(&mut rng);
                    let f = model.eval(incident, exitant);
                    if !(f.is_finite() && f.min_element() >= 0.0) {
                        bad.push(format!("{name}: {f} at {incident}, {exitant}: {}", model.about()));
                    }
                }
            }
            Ok(bad)
        })
        .collect::<Result<Vec<_>, String>>()?
        .concat();
    println!("{} pairs of directions, {} bad values", 300 * share, bad.len());
    bad.iter().take(9).for_each(|line| println!("{line}"));
    if bad.is_empty() {
        Ok(())
    } else {
        Err("a model is not finite or negative somewhere".into())
    }
}
