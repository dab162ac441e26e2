use brdf::Black;
use pdv::{Observation, light_angle};
use rayon::prelude::*;

use super::pca::Pca;
use super::{Grid, GridRow, Source};
use crate::judge::{Judge, Score};
use crate::{Error, Material};

/// Readings of each plane and of the arc by which a model's floor is found.
const DENSE: usize = 360;
/// Farthest from the normal that a perfect instrument reads, degrees: as far as the arms of a rig go.
const REACH_DEG: f64 = 88.0;

/// Rows of black and of PCA, which need no rig.
pub(crate) fn rows(grid: &Grid, judge: &Judge) -> Vec<GridRow> {
    let row = |material: &Material, model: String, taken, score: Score| GridRow {
        material: material.name.clone(),
        source: Source::Baseline,
        planes_deg: String::new(),
        readings: 0,
        arc: 0,
        budget_s: None,
        model,
        taken,
        exposures: 0,
        rig_s: None,
        fit_s: None,
        male: score.male,
        median_rel: score.median_rel,
        p95_rel: score.p95_rel,
    };
    let black = judge.values(&Black);
    let mut rows: Vec<GridRow> = grid
        .materials
        .iter()
        .map(|material| {
            let reference = judge.values(material.brdf.as_ref());
            row(material, "black".to_owned(), 0, judge.score(&reference, &black))
        })
        .collect();
    let pca = Pca::new(&grid.known, judge, &grid.draw);
    let folds: Vec<_> = (0..grid.folds)
        .into_par_iter()
        .map(|fold| pca.fold(fold, grid.folds, &grid.pca))
        .collect();
    for (material, n, score) in folds.into_iter().flatten() {
        let material = &grid.known[material];
        // Those that are not measured are only learnt from.
        if grid
            .materials
            .iter()
            .any(|measured| measured.name == material.name)
        {
            rows.push(row(material, format!("pca-{n}"), n, score));
        }
    }
    rows
}

/// What each model makes of the readings of a perfect instrument, on each set of planes.
///
/// # Errors
/// A model cannot be made.
pub(crate) fn floor(grid: &Grid, judge: &Judge, material: &Material) -> Result<Vec<GridRow>, Error> {
    let reference = judge.values(material.brdf.as_ref());
    let mut sets: Vec<&[f64]> = grid.fixed().map(|plan| plan.planes_deg.as_slice()).collect();
    sets.dedup();
    let arc: Vec<Observation> = (0..DENSE)
        .filter_map(|i| {
            let theta = (REACH_DEG * i as f64 / (DENSE - 1) as f64).to_radians();
            Observation::of(&material.brdf, theta, 0.0)
        })
        .collect();
    let mut rows = Vec::new();
    for planes_deg in sets {
        let planes: Vec<Vec<Observation>> = planes_deg.iter().map(|deg| dense(material, *deg)).collect();
        let plan = super::GridPlan {
            planes_deg: planes_deg.to_vec(),
            readings: DENSE,
            distribution: pdv::Distribution::Capped,
            arc: DENSE,
            budget_s: None,
        };
        for &model in grid.models.iter().filter(|&&model| plan.suits(model)) {
            let begun = std::time::Instant::now();
            let made = report::model(model, &planes, &arc).map_err(|source| Error::Model {
                material: material.name.clone(),
                theta_r_deg: planes_deg[0],
                source,
            })?;
            let fit_s = begun.elapsed().as_secs_f64();
            let score = judge.score(&reference, &judge.values(made.as_ref()));
            rows.push(GridRow {
                material: material.name.clone(),
                source: Source::Floor,
                planes_deg: plan.planes(),
                readings: DENSE,
                arc: DENSE,
                budget_s: None,
                model: model.name().to_owned(),
                taken: plan.total(),
                exposures: 0,
                rig_s: None,
                fit_s: Some(fit_s),
                male: score.male,
                median_rel: score.median_rel,
                p95_rel: score.p95_rel,
            });
        }
    }
    Ok(rows)
}

/// A plane read without noise on both sides, densely about the mirror direction.
fn dense(material: &Material, theta_r_deg: f64) -> Vec<Observation> {
    let theta_r = theta_r_deg.to_radians();
    let reach = REACH_DEG.to_radians().sin();
    let ends = [theta_r.sin() - reach, theta_r.sin() + reach];
    let spread = pdv::spread(
        pdv::Distribution::Capped,
        theta_r,
        &[ends[0]..=ends[1]],
        DENSE,
        1e-6,
    );
    spread
        .deviations
        .iter()
        .filter(|&&d| light_angle(theta_r, d).is_some())
        .filter_map(|&d| Observation::of(&material.brdf, theta_r, d))
        .collect()
}
