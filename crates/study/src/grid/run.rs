use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::shard::{self, Shard, WHOLE};
use super::task::{Known, Task};
use super::{Grid, GridPlan, GridRow, Source, baseline, document};
use crate::judge::Judge;
use crate::ledger::{self, Ledger};
use crate::{Error, Material, Progress, measure};

/// Runs a grid into a directory: rows.csv grows as it goes and is where an interrupted study goes on; what shards have done
/// there is not done again. Rows in their order, fronts, plots and the page follow at its end. Returns what it found, in
/// words.
///
/// # Errors
/// The directory cannot be written, or somebody else runs the study there; a capture or a model fails.
pub(crate) fn run(grid: &Grid, directory: &Path, progress: &Progress<'_>) -> Result<String, Error> {
    let ledger = Ledger::<GridRow>::open(&directory.join(WHOLE))?;
    let known = Known::of(&rows(directory)?);
    let tasks = Task::all(grid);
    let open: Vec<&Task<'_>> = tasks.iter().filter(|task| !known.has(grid, task)).collect();
    carry_out(grid, &open, ledger, progress)?;
    document::write(grid, &in_order(rows(directory)?), directory)
}

/// Does a shard's part of a grid, as far as it is not done yet, into a ledger of its own. Returns in words what it did.
///
/// # Errors
/// As for [`run`].
pub(crate) fn run_shard(
    grid: &Grid,
    directory: &Path,
    shard: Shard,
    progress: &Progress<'_>,
) -> Result<String, Error> {
    let ledger = Ledger::<GridRow>::open(&directory.join(shard.ledger()))?;
    let known = Known::of(&rows(directory)?);
    let tasks = Task::all(grid);
    let own: Vec<&Task<'_>> = shard.part(&tasks).collect();
    let open: Vec<&Task<'_>> = own
        .iter()
        .copied()
        .filter(|task| !known.has(grid, task))
        .collect();
    let begun = Instant::now();
    carry_out(grid, &open, ledger, progress)?;
    Ok(format!(
        "shard {shard} has {} of {} tasks, of which {} were done now, in {:.1} s; `gonioctl study merge` makes the study of all",
        own.len(),
        tasks.len(),
        open.len(),
        begun.elapsed().as_secs_f64(),
    ))
}

/// Makes the study of what its shards did: the same files as without shards.
///
/// # Errors
/// Something has not been done yet; the directory cannot be read or written.
pub(crate) fn merge(grid: &Grid, directory: &Path) -> Result<String, Error> {
    let rows = rows(directory)?;
    let known = Known::of(&rows);
    let tasks = Task::all(grid);
    let missing = tasks.iter().filter(|task| !known.has(grid, task)).count();
    if missing > 0 {
        return Err(Error::Unfinished {
            missing,
            of: tasks.len(),
            directory: directory.to_owned(),
        });
    }
    document::write(grid, &in_order(rows), directory)
}

/// Does tasks on all cores, the dearest first.
fn carry_out(
    grid: &Grid,
    tasks: &[&Task<'_>],
    ledger: Ledger<GridRow>,
    progress: &Progress<'_>,
) -> Result<(), Error> {
    let judge = Judge::new(&grid.draw);
    let ledger = Mutex::new(ledger);
    let total: u64 = tasks.iter().map(|task| task.cost(grid)).sum();
    let done = AtomicU64::new(0);
    progress(0, total);
    tasks.par_iter().try_for_each(|task| -> Result<(), Error> {
        let rows = match task {
            Task::Baselines => baseline::rows(grid, &judge),
            Task::Capture(material, plan) => {
                let (judge, reference) = judge.of(material, grid.draw.theta_max);
                captured(grid, &judge, &reference, material, plan)?
            }
            Task::Floor(material) => {
                let (judge, reference) = judge.of(material, grid.draw.theta_max);
                baseline::floor(grid, &judge, &reference, material)?
            }
        };
        ledger.lock().expect("nobody panics with it").append(&rows)?;
        let cost = task.cost(grid);
        progress(done.fetch_add(cost, Ordering::Relaxed) + cost, total);
        Ok(())
    })
}

/// All rows in a directory, whoever made them: those of the whole study, where an older version kept what it had done, then
/// those of all ledgers.
fn rows(directory: &Path) -> Result<Vec<GridRow>, Error> {
    let mut rows = ledger::read(&directory.join("study.csv"))?;
    for path in shard::ledgers(directory)? {
        rows.extend(ledger::read(&path)?);
    }
    Ok(rows)
}

/// Rows as they stand in study.csv: cores and shards finish in any order, and the same study is the same file.
fn in_order(mut rows: Vec<GridRow>) -> Vec<GridRow> {
    rows.sort_by_cached_key(GridRow::key);
    // Of what was interrupted half-way, some rows were made again.
    rows.dedup_by(|a, b| a.key() == b.key());
    rows
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
