use serde::Serialize;

use super::front::{FamilyLine, Line, Point, front, within};
use super::outcome::Outcome;
use super::pca::Placement;
use super::{Grid, GridRow, Source};

/// Seconds of rig time over which the fronts are compared.
pub(crate) const FROM_S: f64 = 10.0;
pub(crate) const TO_S: f64 = 600.0;

/// A baseline against the program's own front.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Against {
    pub(crate) baseline: String,
    /// Least of baseline over own front, in the median of MALE, over all times from 10 s to 10 min; below 1 the
    /// baseline wins somewhere.
    pub(crate) least_ratio: f64,
    /// Where that is, s of rig time.
    pub(crate) at_s: f64,
}

/// PCA of readings without noise against the program's own front.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Pca {
    pub(crate) readings: usize,
    /// Where they stand, in words.
    pub(crate) placed: &'static str,
    pub(crate) male_mean: f64,
    pub(crate) male_median: f64,
    pub(crate) male_p10: f64,
    pub(crate) male_p90: f64,
    pub(crate) median_rel: f64,
    /// Seconds of rig time from which the own front lies below it; `None`: nowhere.
    pub(crate) beaten_from_s: Option<f64>,
}

/// summary.json.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Summary {
    pub(crate) materials: usize,
    pub(crate) captures: usize,
    pub(crate) baselines: Vec<Against>,
    pub(crate) pca: Vec<Pca>,
    pub(crate) front: Vec<Line>,
    pub(crate) floors: Vec<Line>,
    /// The plans of the front over the materials of each family.
    pub(crate) families: Vec<FamilyLine>,
}

impl Summary {
    pub(crate) fn new(grid: &Grid, outcome: &Outcome<'_>) -> Self {
        let own = outcome.own();
        let mut baselines: Vec<Against> = outcome
            .approaches
            .iter()
            .filter(|approach| !approach.own)
            .filter_map(|approach| against(&approach.name, &front(&approach.points), &own))
            .collect();
        if let Some(mut black) = outcome.baseline("black") {
            black.rig_s = 0.0;
            baselines.extend(against("black", &[&black], &own));
        }
        let placed = Placement::ALL
            .into_iter()
            .flat_map(|placement| grid.pca.iter().map(move |&n| (placement, n)));
        let pca = placed.filter_map(|(placement, n)| {
            let point = outcome.baseline(&placement.model(n))?;
            Some(Pca {
                readings: n,
                placed: placement.words(),
                male_mean: point.male.mean,
                male_median: point.male.median,
                male_p10: point.male.p10,
                male_p90: point.male.p90,
                median_rel: point.median_rel.median,
                beaten_from_s: own
                    .iter()
                    .find(|own| own.male.median < point.male.median)
                    .map(|own| own.rig_s),
            })
        });
        Self {
            materials: grid.materials.len(),
            captures: captures(outcome.rows),
            baselines,
            pca: pca.collect(),
            front: own.iter().map(|point| point.line(&point.model)).collect(),
            floors: outcome
                .floors
                .iter()
                .map(|point| point.line(&point.model))
                .collect(),
            families: outcome.by_family(),
        }
    }
}

/// How often a material was captured, with whatever plan.
fn captures(rows: &[GridRow]) -> usize {
    let mut captures: Vec<_> = rows
        .iter()
        .filter(|row| row.source == Source::Rig)
        .map(|row| {
            (
                &row.material,
                &row.planes_deg,
                row.readings,
                row.arc,
                &row.motion,
                row.budget_s,
            )
        })
        .collect();
    captures.sort();
    captures.dedup();
    captures.len()
}

/// A baseline's front against the own one, at every time at which either changes; `None` where it has none in time.
fn against(name: &str, baseline: &[&Point], own: &[&Point]) -> Option<Against> {
    let times = baseline.iter().chain(own).map(|point| point.rig_s);
    times
        .chain([FROM_S, TO_S])
        .filter(|seconds| (FROM_S..=TO_S).contains(seconds))
        .filter_map(|seconds| {
            let ratio = within(baseline, seconds)?.male.median
                / within(own, seconds).map_or(f64::INFINITY, |point| point.male.median);
            Some(Against {
                baseline: name.to_owned(),
                least_ratio: ratio,
                at_s: seconds,
            })
        })
        .min_by(|a, b| a.least_ratio.total_cmp(&b.least_ratio))
}
