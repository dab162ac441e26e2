use brdf::Black;
use glam::DVec3;
use pdv::{Observation, light_angle};
use rayon::prelude::*;

use super::pca::{Pca, Placement};
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
        motion: String::new(),
        budget_s: None,
        model,
        taken,
        exposures: 0,
        rig_s: None,
        fit_s: None,
        male: score.male,
        median_rel: score.median_rel,
        p95_rel: score.p95_rel,
        family: material.family.clone(),
    };
    let mut rows: Vec<GridRow> = grid
        .materials
        .iter()
        .map(|material| {
            let (judge, reference) = judge.of(material, grid.draw.theta_max);
            let black = judge.values(&Black);
            row(material, "black".to_owned(), 0, judge.score(&reference, &black))
        })
        .collect();
    // Of scattered readings alone there is nothing where PCA would have its own.
    let known: Vec<&Material> = grid
        .known
        .iter()
        .filter(|material| material.known.is_none())
        .collect();
    for placement in Placement::ALL {
        let pca = Pca::new(&known, judge, &grid.draw, placement);
        let found: Vec<_> = families(&known)
            .into_par_iter()
            .map(|family| pca.without(family, &grid.pca))
            .collect();
        for (material, n, score) in found.into_iter().flatten() {
            // Those that are not measured are only learnt from.
            if measured(grid, known[material]) {
                rows.push(row(known[material], placement.model(n), n, score));
            }
        }
    }
    rows
}

/// How many rows [`rows`] makes.
pub(crate) fn count(grid: &Grid) -> usize {
    let tested = |material: &&Material| material.known.is_none() && measured(grid, material);
    let known: Vec<&Material> = grid
        .known
        .iter()
        .filter(|material| material.known.is_none())
        .collect();
    let of_pca = match families(&known).len() > 1 {
        true => known.into_iter().filter(tested).count() * grid.pca.len() * Placement::ALL.len(),
        false => 0,
    };
    grid.materials.len() + of_pca
}

fn measured(grid: &Grid, material: &Material) -> bool {
    grid.materials
        .iter()
        .any(|measured| measured.name == material.name)
}

/// The families of some materials.
fn families<'a>(materials: &[&'a Material]) -> Vec<&'a str> {
    let mut families: Vec<&str> = materials
        .iter()
        .map(|material| material.family.as_str())
        .collect();
    families.sort_unstable();
    families.dedup();
    families
}

/// What each model makes of the readings of a perfect instrument, on each set of planes.
///
/// # Errors
/// A model cannot be made.
pub(crate) fn floor(
    grid: &Grid,
    judge: &Judge,
    reference: &[DVec3],
    material: &Material,
) -> Result<Vec<GridRow>, Error> {
    let arc: Vec<Observation> = (0..DENSE)
        .filter_map(|i| {
            let theta = (REACH_DEG * i as f64 / (DENSE - 1) as f64).to_radians();
            Observation::of(&material.brdf, theta, 0.0)
        })
        .collect();
    let mut rows = Vec::new();
    for planes_deg in grid.sets() {
        let planes: Vec<Vec<Observation>> = planes_deg.iter().map(|deg| dense(material, *deg)).collect();
        let plan = super::GridPlan {
            planes_deg: planes_deg.to_vec(),
            snake: 0,
            readings: DENSE,
            distribution: pdv::Distribution::Capped,
            arc: DENSE,
            mode: sweep::Mode::Step,
            speed_deg_s: 0,
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
            let score = judge.score(reference, &judge.values(made.as_ref()));
            rows.push(GridRow {
                material: material.name.clone(),
                source: Source::Floor,
                planes_deg: plan.planes(),
                readings: DENSE,
                arc: DENSE,
                motion: String::new(),
                budget_s: None,
                model: model.name().to_owned(),
                taken: plan.total(),
                exposures: 0,
                rig_s: None,
                fit_s: Some(fit_s),
                male: score.male,
                median_rel: score.median_rel,
                p95_rel: score.p95_rel,
                family: material.family.clone(),
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
