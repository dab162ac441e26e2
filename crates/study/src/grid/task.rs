use std::collections::{HashMap, HashSet};

use super::row::Key;
use super::{Grid, GridPlan, GridRow, Source, baseline};
use crate::Material;

/// What a capture costs beside its readings, in readings: planning, dark readings, the runtime.
const CAPTURE_COST: u64 = 60;
/// What the floor of one material costs, in readings.
const FLOOR_COST: u64 = 5000;
/// What the baselines cost for each material that they know, in readings.
const BASELINE_COST: u64 = 500;

/// One thing to do, whose rows are written together.
#[derive(Clone, Copy)]
pub(crate) enum Task<'a> {
    /// A capture and all models that suit it.
    Capture(&'a Material, &'a GridPlan),
    /// The floors of one material.
    Floor(&'a Material),
    /// Black and PCA, of all materials at once.
    Baselines,
}

impl<'a> Task<'a> {
    /// Everything that a grid asks for, the dearest first, so that cores end together; always in the same order.
    pub(crate) fn all(grid: &'a Grid) -> Vec<Self> {
        let mut tasks = vec![Self::Baselines];
        for material in &grid.materials {
            tasks.push(Self::Floor(material));
            tasks.extend(grid.plans.iter().map(|plan| Self::Capture(material, plan)));
        }
        // Stable: what costs the same stays in the order of the file.
        tasks.sort_by_key(|task| std::cmp::Reverse(task.cost(grid)));
        tasks
    }

    /// How long it takes, in readings.
    pub(crate) fn cost(&self, grid: &Grid) -> u64 {
        match self {
            Self::Capture(_, plan) => CAPTURE_COST + plan.total() as u64,
            Self::Floor(_) => FLOOR_COST,
            Self::Baselines => BASELINE_COST * grid.known.len() as u64,
        }
    }
}

/// What is done already.
pub(crate) struct Known {
    keys: HashSet<Key>,
    floors: HashMap<String, usize>,
    baselines: usize,
}

impl Known {
    pub(crate) fn of(rows: &[GridRow]) -> Self {
        let keys: HashSet<Key> = rows.iter().map(GridRow::key).collect();
        let mut floors = HashMap::new();
        for key in keys.iter().filter(|key| key.1 == Source::Floor) {
            *floors.entry(key.0.clone()).or_default() += 1;
        }
        Self {
            baselines: keys.iter().filter(|key| key.1 == Source::Baseline).count(),
            floors,
            keys,
        }
    }

    /// Whether all rows of a task are there.
    pub(crate) fn has(&self, grid: &Grid, task: &Task<'_>) -> bool {
        match task {
            Task::Baselines => self.baselines >= baseline::count(grid),
            Task::Floor(material) => {
                let suited = |set: &[f64]| {
                    let plan = grid.fixed().find(|plan| plan.planes_deg == set);
                    plan.map_or(0, |plan| {
                        grid.models.iter().filter(|&&model| plan.suits(model)).count()
                    })
                };
                let wanted: usize = grid.sets().into_iter().map(suited).sum();
                self.floors.get(&material.name).copied().unwrap_or_default() >= wanted
            }
            Task::Capture(material, plan) => {
                let mut models = grid.models.iter().filter(|&&model| plan.suits(model));
                models.all(|model| {
                    self.keys.contains(&(
                        material.name.clone(),
                        Source::Rig,
                        plan.planes(),
                        plan.readings,
                        plan.arc,
                        plan.motion(),
                        plan.budget_s,
                        model.name().to_owned(),
                    ))
                })
            }
        }
    }
}
