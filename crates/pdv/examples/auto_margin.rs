//! What the margin of `pdv::Auto` costs and gains: `cargo run --release -p pdv --example auto_margin -- [FOLDER]`.
//!
//! Models are made of noise-free readings of the fitted materials, or of the MERL files (`*.binary`) in FOLDER. For each
//! margin it says how often `planes` would be left, how often for a better model, and what the worst error would be in
//! units of that of `planes`.

use brdf::{Brdf, Fitted, MerlTable};
use pdv::{Auto, Bivariate, Distribution, Draw, Observation, Planes, Separable, compare, spread};

const PLANS: [(&[f64], usize, usize); 3] = [
    (&[15.0, 60.0], 21, 6),
    (&[20.0, 45.0, 70.0], 14, 6),
    (&[10.0, 35.0, 60.0, 75.0], 43, 10),
];
const MARGINS: [f64; 6] = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5];

fn plane(brdf: &dyn Brdf, deg: f64, readings: usize) -> Vec<Observation> {
    let theta_r = deg.to_radians();
    let deviation = |deg: f64| deg.to_radians().sin() + theta_r.sin();
    let ranges = [
        deviation(-85.0)..=deviation(deg - 5.0),
        deviation((deg + 5.0).min(85.0))..=deviation(85.0),
    ];
    let spread = spread(Distribution::Lobe, theta_r, &ranges, readings, 1.5e-3);
    let read = |&d: &f64| Observation::of(brdf, theta_r, d);
    spread.deviations.iter().filter_map(read).collect()
}

/// Of each plan the least error of another model and its MALE, both in units of those of `planes`.
fn ratios(brdf: &dyn Brdf) -> Result<Vec<(f64, f64)>, pdv::Error> {
    let draw = Draw {
        pairs: 10_000,
        ..Draw::default()
    };
    let mut ratios = Vec::new();
    for (planes_deg, readings, arc) in PLANS {
        let planes: Vec<_> = planes_deg.iter().map(|&deg| plane(brdf, deg, readings)).collect();
        let at = |n: usize| (2.5 + 82.5 * n as f64 / (arc - 1) as f64).to_radians();
        let along: Vec<_> = (0..arc)
            .filter_map(|n| Observation::of(brdf, at(n), 0.0))
            .collect();
        let auto = Auto::from_observations(&planes, &along)?;
        let models: [&dyn Brdf; 3] = [
            &Planes::from_observations(&planes, &along)?,
            &Bivariate::from_observations(&planes, &along)?,
            &Separable::from_observations(&planes[0], &along)?,
        ];
        let male = compare(brdf, &models, &draw)
            .into_iter()
            .map(|found| found.overall.male.unwrap_or(f64::NAN));
        let errors = auto
            .errors()
            .iter()
            .map(|(_, error)| error.unwrap_or(f64::INFINITY));
        let all: Vec<(f64, f64)> = errors.zip(male).collect();
        let best = all[1..]
            .iter()
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or(&all[0]);
        ratios.push((best.0 / all[0].0, best.1 / all[0].1));
    }
    Ok(ratios)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut all = Vec::new();
    if let Some(folder) = std::env::args().nth(1) {
        for entry in std::fs::read_dir(folder)? {
            let path = entry?.path();
            if path.extension().is_some_and(|extension| extension == "binary") {
                all.extend(ratios(&MerlTable::read(&path)?)?);
            }
        }
    } else {
        for (_, material) in Fitted::all() {
            all.extend(ratios(&material)?);
        }
    }
    println!(
        "margin   left of {:>4}   better   worst MALE, in that of planes",
        all.len()
    );
    for margin in MARGINS {
        let left: Vec<f64> = all
            .iter()
            .filter(|(error, _)| *error <= margin)
            .map(|(_, male)| *male)
            .collect();
        let worst = left.iter().copied().fold(1.0, f64::max);
        let better = left.iter().filter(|male| **male < 1.0).count();
        println!("{margin:.1}      {:>12}   {better:>6}   {worst:.2}", left.len());
    }
    Ok(())
}
