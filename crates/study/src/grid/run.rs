use std::collections::HashSet;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::row::Key;
use super::{Grid, GridPlan, GridRow, Source, baseline, document};
use crate::judge::Judge;
use crate::ledger::Ledger;
use crate::{Error, Material, Progress, measure};

/// What a capture costs beside its readings, in readings: planning, dark readings, the runtime.
const CAPTURE_COST: u64 = 60;
/// What the floor and the baselines of one material cost, in readings.
const FLOOR_COST: u64 = 5000;

/// One thing to do, on one core.
enum Task<'a> {
    Capture(&'a Material, &'a GridPlan),
    Floor(&'a Material),
}

impl Task<'_> {
    fn material(&self) -> &Material {
        match self {
            Self::Capture(material, _) | Self::Floor(material) => material,
        }
    }

    fn cost(&self) -> u64 {
        match self {
            Self::Capture(_, plan) => CAPTURE_COST + plan.total() as u64,
            Self::Floor(_) => FLOOR_COST,
        }
    }
}

/// Runs a grid into a directory: study.csv grows as it goes and is where an interrupted study goes on; the fronts,
/// plots and the page follow at its end. Returns what it found, in words.
///
/// # Errors
/// The directory holds another study or cannot be written; a capture or a model fails.
pub(crate) fn run(grid: &Grid, directory: &Path, progress: &Progress<'_>) -> Result<String, Error> {
    let judge = Judge::new(&grid.draw);
    let ledger = Mutex::new(Ledger::<GridRow>::open(&directory.join("study.csv"))?);
    let known: Vec<GridRow> = ledger.lock().expect("nobody panics with it").rows().to_vec();
    let known: HashSet<_> = known.iter().map(GridRow::key).collect();
    let tasks = tasks(grid, &known);
    let total: u64 = tasks.iter().map(Task::cost).sum();
    let done = AtomicU64::new(0);
    progress(0, total);
    tasks.par_iter().try_for_each(|task| -> Result<(), Error> {
        let material = task.material();
        let (judge, reference) = judge.of(material, grid.draw.theta_max);
        let rows = match task {
            Task::Capture(_, plan) => captured(grid, &judge, &reference, material, plan)?,
            Task::Floor(_) => baseline::floor(grid, &judge, &reference, material)?,
        };
        ledger.lock().expect("nobody panics with it").append(&rows)?;
        progress(
            done.fetch_add(task.cost(), Ordering::Relaxed) + task.cost(),
            total,
        );
        Ok(())
    })?;
    let mut ledger = ledger.into_inner().expect("nobody panics with it");
    let baselines = baseline::count(grid);
    if known.iter().filter(|key| key.1 == Source::Baseline).count() < baselines {
        ledger.append(&baseline::rows(grid, &judge))?;
    }
    let mut rows = ledger.rows().to_vec();
    // Cores finish in any order; the same study is the same file.
    rows.sort_by_cached_key(GridRow::key);
    // Of what was interrupted half-way, some rows were made again.
    rows.dedup_by(|a, b| a.key() == b.key());
    document::write(grid, &rows, directory)
}

/// What is not known yet, the dearest first, so that the cores end together.
fn tasks<'a>(grid: &'a Grid, known: &HashSet<Key>) -> Vec<Task<'a>> {
    let suited = |set: &[f64]| {
        let plan = grid.fixed().find(|plan| plan.planes_deg == set);
        plan.map_or(0, |plan| {
            grid.models.iter().filter(|&&model| plan.suits(model)).count()
        })
    };
    let of_floor: usize = grid.sets().into_iter().map(suited).sum();
    let mut tasks = Vec::new();
    for material in &grid.materials {
        let floors = known
            .iter()
            .filter(|key| key.0 == material.name && key.1 == Source::Floor);
        if floors.count() < of_floor {
            tasks.push(Task::Floor(material));
        }
        for plan in &grid.plans {
            let mut models = grid.models.iter().filter(|&&model| plan.suits(model));
            let whole = models.all(|model| {
                known.contains(&(
                    material.name.clone(),
                    Source::Rig,
                    plan.planes(),
                    plan.readings,
                    plan.arc,
                    plan.motion(),
                    plan.budget_s,
                    model.name().to_owned(),
                ))
            });
            if !whole {
                tasks.push(Task::Capture(material, plan));
            }
        }
    }
    tasks.sort_by_key(|task| std::cmp::Reverse(task.cost()));
    tasks
}

/// One capture and every model that suits it.
fn captured(
    grid: &Grid,
    judge: &Judge,
    reference: &[DVec3],
    material: &Material,
    plan: &GridPlan,
) -> Result<Vec<GridRow>, Error> {
    let mut rig = plan.rig()?;
    let seed = seed(grid.draw.seed, &material.name, plan);
    rig.sim.insert("seed".to_owned(), seed.into());
    let measured = measure(&plan.job()?, &rig, material.brdf.clone())?;
    let models = grid.models.iter().filter(|&&model| plan.suits(model));
    models
        .map(|&model| {
            let begun = Instant::now();
            let made =
                report::model(model, &measured.planes, &measured.arc).map_err(|source| Error::Model {
                    material: material.name.clone(),
                    theta_r_deg: plan.planes_deg.first().copied().unwrap_or_default(),
                    source,
                })?;
            let fit_s = begun.elapsed().as_secs_f64();
            let score = judge.score(reference, &judge.values(made.as_ref()));
            Ok(GridRow {
                material: material.name.clone(),
                source: Source::Rig,
                planes_deg: plan.planes(),
                readings: plan.readings,
                arc: plan.arc,
                motion: plan.motion(),
                budget_s: plan.budget_s,
                model: model.name().to_owned(),
                taken: measured.readings,
                exposures: measured.exposures,
                rig_s: Some(measured.rig_s),
                fit_s: Some(fit_s),
                male: score.male,
                median_rel: score.median_rel,
                p95_rel: score.p95_rel,
                family: material.family.clone(),
            })
        })
        .collect()
}

/// Of a capture: another for each, and the same whenever the study is run (FNV-1a).
fn seed(study: u64, material: &str, plan: &GridPlan) -> i64 {
    let text = format!("{material}/{}/{}/{}", plan.planes(), plan.readings, plan.arc);
    let hash = text.bytes().fold(0xcbf2_9ce4_8422_2325 ^ study, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    (hash >> 1) as i64
}
