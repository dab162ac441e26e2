use std::sync::atomic::{AtomicU64, Ordering};

use brdf::Brdf;
use glam::DVec3;
use pdv::metric::PooledSums;
use pdv::{Draw, Separable};
use rayon::prelude::*;

use super::Row;
use crate::judge::Judge;
use crate::{Material, Progress};

/// Pairs that are drawn at once and then used for every material: few enough to stay in the cache.
const CHUNK: u64 = 4096;
/// Sums that are kept apart, so that the result does not depend on the number of cores.
const LANES: u64 = 64;
/// Pairs of which quantiles are taken.
const QUANTILE_PAIRS: u64 = 50_000;

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
    let lanes: Vec<Vec<Vec<PooledSums>>> = (0..LANES.min(chunks))
        .into_par_iter()
        .map(|lane| {
            let mut sums: Vec<Vec<PooledSums>> = cases
                .iter()
                .map(|case| vec![PooledSums::default(); case.models.len()])
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
                    let mut sum = PooledSums::default();
                    lanes.iter().for_each(|lane| sum.merge(&lane[i][k]));
                    let score = judge.score(&reference, &judge.values(model));
                    let metrics = sum.metrics(draw.pairs);
                    Row {
                        material: case.material.name.clone(),
                        theta_r_deg: model.theta_r().to_degrees(),
                        male: metrics.male.unwrap_or(f64::NAN),
                        median_rel: score.median_rel,
                        p95_rel: score.p95_rel,
                        rel_rms: metrics.rel_rms.unwrap_or(f64::NAN),
                        eq4: metrics.eq4,
                        eq4_black: metrics.eq4_black,
                        pairs: metrics.pairs,
                        left_out: metrics.left_out,
                    }
                })
                .collect()
        })
        .collect()
}

fn add(case: &Case<'_>, pairs: &[(DVec3, DVec3)], sums: &mut [PooledSums]) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_metrics_of_a_run() {
        let material = Material::new("alum-bronze", brdf::specimen("alum-bronze").unwrap());
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
