use std::sync::atomic::{AtomicU64, Ordering};

use brdf::Brdf;
use glam::DVec3;
use pdv::{Draw, Separable};
use rayon::prelude::*;

use super::Row;
use crate::judge::{FLOOR, Judge};
use crate::{Material, Progress};

/// Pairs that are drawn at once and then used for every material: few enough to stay in the cache.
const CHUNK: u64 = 4096;
/// Sums that are kept apart, so that the result does not depend on the number of cores.
const LANES: u64 = 64;
/// Pairs of which quantiles are taken.
const QUANTILE_PAIRS: u64 = 50_000;
/// A product of ratios is turned into a logarithm when it passes this: three more of 1e13 each, the most that a model
/// can be off, still leave it finite.
const LARGE: f64 = 1e200;

/// A material with its reconstructions.
pub(crate) struct Case<'a> {
    pub(crate) material: &'a Material,
    pub(crate) models: Vec<Separable>,
}

/// Compares all reconstructions with their materials over the same pairs: material by material and angle by angle.
///
/// Directions are drawn once for all, the materials evaluated once for all angles, on all cores.
pub(crate) fn compare(cases: &[Case<'_>], draw: &Draw, progress: &Progress<'_>) -> Vec<Vec<Row>> {
    let done = AtomicU64::new(0);
    let chunks = draw.pairs.div_ceil(CHUNK);
    let lanes: Vec<Vec<Vec<Sums>>> = (0..LANES.min(chunks))
        .into_par_iter()
        .map(|lane| {
            let mut sums: Vec<Vec<Sums>> = cases
                .iter()
                .map(|case| vec![Sums::default(); case.models.len()])
                .collect();
            for chunk in (lane..chunks).step_by(LANES as usize) {
                let pairs = CHUNK.min(draw.pairs - chunk * CHUNK);
                let judge = Judge::stream(&Draw { pairs, ..*draw }, chunk);
                for (case, sums) in cases.iter().zip(&mut sums) {
                    add(case, judge.pairs(), sums);
                }
                progress(done.fetch_add(pairs, Ordering::Relaxed) + pairs, draw.pairs);
            }
            sums
        })
        .collect();
    let judge = Judge::new(&Draw {
        pairs: draw.pairs.min(QUANTILE_PAIRS),
        ..*draw
    });
    cases
        .par_iter()
        .enumerate()
        .map(|(i, case)| {
            let reference = judge.values(case.material.brdf.as_ref());
            case.models
                .iter()
                .enumerate()
                .map(|(k, model)| {
                    let mut sum = Sums::default();
                    lanes.iter().for_each(|lane| sum.merge(&lane[i][k]));
                    let score = judge.score(&reference, &judge.values(model));
                    let row = Row {
                        material: case.material.name.clone(),
                        theta_r_deg: model.theta_r().to_degrees(),
                        median_rel: score.median_rel,
                        p95_rel: score.p95_rel,
                        ..Row::default()
                    };
                    sum.row(row, draw.pairs)
                })
                .collect()
        })
        .collect()
}

fn add(case: &Case<'_>, pairs: &[(DVec3, DVec3)], sums: &mut [Sums]) {
    for &(incident, exitant) in pairs {
        if !case.material.brdf.valid(incident, exitant) {
            continue;
        }
        let f = case.material.brdf.eval(incident, exitant);
        for (model, sums) in case.models.iter().zip(&mut *sums) {
            sums.add(f, model.eval(incident, exitant), incident.z);
        }
    }
}

/// Running sums over pairs and channels.
#[derive(Clone, Debug)]
struct Sums {
    valid: u64,
    /// Sum of |ln ratio| but for what is still in `ratios`.
    male: f64,
    /// Product of ratios ≥ 1: one logarithm for many pairs.
    ratios: f64,
    squares: f64,
    positive: u64,
    squares_without_floor: f64,
}

impl Default for Sums {
    fn default() -> Self {
        Self {
            valid: 0,
            male: 0.0,
            ratios: 1.0,
            squares: 0.0,
            positive: 0,
            squares_without_floor: 0.0,
        }
    }
}

impl Sums {
    #[inline]
    fn add(&mut self, f: DVec3, g: DVec3, cos_i: f64) {
        let (a, b) = (f * cos_i + 1.0, g * cos_i + 1.0);
        self.ratios *= (a.max(b) / a.min(b)).element_product();
        if self.ratios > LARGE {
            self.take();
        }
        let error = g - f;
        self.squares += (error / f.max(DVec3::splat(FLOOR))).length_squared();
        let positive = f.cmpgt(DVec3::ZERO);
        let relative = DVec3::select(positive, error / f, DVec3::ZERO);
        self.squares_without_floor += relative.length_squared();
        self.positive += u64::from(positive.bitmask().count_ones());
        self.valid += 3;
    }

    fn take(&mut self) {
        self.male += self.ratios.ln();
        self.ratios = 1.0;
    }

    fn merge(&mut self, other: &Self) {
        self.valid += other.valid;
        self.male += other.male + other.ratios.ln();
        self.squares += other.squares;
        self.positive += other.positive;
        self.squares_without_floor += other.squares_without_floor;
    }

    fn row(&self, row: Row, drawn: u64) -> Row {
        let n = self.valid as f64;
        let positive = self.positive as f64;
        let eq4 =
            |squares: f64| (self.positive > 0).then(|| (squares / positive).sqrt() / (positive / 3.0).sqrt());
        Row {
            male: self.male / n,
            rel_rms: (self.squares / n).sqrt(),
            eq4: eq4(self.squares_without_floor),
            eq4_black: eq4(positive),
            pairs: self.positive / 3,
            left_out: 1.0 - positive / (3 * drawn) as f64,
            ..row
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_metrics_of_a_run() {
        let material = Material {
            name: "alum-bronze".to_owned(),
            brdf: brdf::specimen("alum-bronze").unwrap(),
        };
        let arc: Vec<f64> = (0..30).map(|i| f64::from(i) * 0.05).collect();
        let deviations: Vec<f64> = (0..60).map(|i| (f64::from(i) / 60.0).powi(3) * 1.9).collect();
        let model = Separable::sample(&material.brdf, 1.2, &deviations, &arc, 0.0).unwrap();
        let draw = Draw {
            pairs: 300_000,
            ..Draw::default()
        };
        let metrics = pdv::compare(&material.brdf, &[&model], &draw)[0].overall;
        let case = Case {
            material: &material,
            models: vec![model],
        };
        let row = &compare(&[case], &draw, &|_, _| ())[0][0];
        assert_eq!((row.pairs, row.eq4_black), (metrics.pairs, metrics.eq4_black));
        for (ours, theirs) in [
            (row.male, metrics.male),
            (row.rel_rms, metrics.rel_rms),
            (row.median_rel, metrics.median_rel),
            (row.p95_rel, metrics.p95_rel),
            (row.eq4.unwrap(), metrics.eq4),
        ] {
            let theirs = theirs.unwrap();
            // Other random numbers.
            assert!((ours / theirs - 1.0).abs() < 0.03, "{ours}, not {theirs}");
        }
    }
}
