use std::path::Path;

use pdv::{Distribution, Draw};
use serde::Deserialize;
use sweep::{Mode, Model};

use super::GridPlan;
use crate::check::Check;
use crate::material::{Material, Names};
use crate::{Error, Kind};

/// A checked study of error against run time.
#[derive(Clone)]
pub struct Grid {
    /// What is measured.
    pub materials: Vec<Material>,
    /// What log-relative PCA learns from: all that the file names, of which `materials` are every n-th.
    pub known: Vec<Material>,
    /// What is taken of each.
    pub plans: Vec<GridPlan>,
    /// What is made of it.
    pub models: Vec<Model>,
    /// Numbers of readings of log-relative PCA, whose basis is made of the materials of all other families.
    pub pca: Vec<usize>,
    /// On which pairs all are judged; its seed is that of the captures, too.
    pub draw: Draw,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    #[serde(rename = "study")]
    _kind: Kind,
    materials: Names,
    every: usize,
    models: Vec<Model>,
    plans: RawPlans,
    adaptive: Option<RawAdaptive>,
    pca: RawPca,
    compare: RawCompare,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPlans {
    planes_deg: Vec<Vec<f64>>,
    readings: Vec<usize>,
    arc: Vec<usize>,
    distribution: Distribution,
    #[serde(default)]
    snakes: Vec<usize>,
    #[serde(default = "step")]
    modes: Vec<Mode>,
    #[serde(default = "usual")]
    speeds_deg_s: Vec<u32>,
}

/// A study that says nothing of it has the arms stop for each reading,
fn step() -> Vec<Mode> {
    vec![Mode::Step]
}

/// and move as the built-in rig file has it.
fn usual() -> Vec<u32> {
    vec![USUAL_DEG_S]
}

const USUAL_DEG_S: u32 = 60;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawAdaptive {
    planes_deg: Vec<f64>,
    readings: usize,
    arc: usize,
    budget_s: Vec<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPca {
    readings: Vec<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCompare {
    pairs: u64,
    theta_max_deg: f64,
    seed: u64,
}

impl Grid {
    /// Reads the text of a study file; `file` names it in errors. A `quick` one has every fifteenth of the materials, a
    /// fifth of the pairs, and of readings and arc the first, the middle and the last.
    ///
    /// # Errors
    /// An unknown or missing key, a wrong type, a value out of range, or a material that is not known.
    pub fn parse(text: &str, file: &str, quick: bool) -> Result<Self, Error> {
        let check = Check { file };
        let raw: Raw = check.parse(text)?;
        check.number("every", raw.every, raw.every > 0, "1 …")?;
        let materials = raw.materials.materials(file)?;
        let every = if quick { raw.every.max(15) } else { raw.every };
        if raw.models.is_empty() {
            return Err(check.range("models", "empty", "at least one"));
        }
        let plans = raw.plans;
        if plans.planes_deg.is_empty() || plans.planes_deg.iter().any(Vec::is_empty) {
            return Err(check.range("plans.planes_deg", "empty", "lists of at least one angle"));
        }
        check.list("plans.readings", &plans.readings, |n| n > 0, "1 … 2000")?;
        check.list("plans.arc", &plans.arc, |n| n <= 2000, "0 … 2000")?;
        let known = |n| sweep::Leg::snake(n).is_some();
        if !plans.snakes.iter().all(|&n| known(n)) {
            return Err(check.range("plans.snakes", format!("{:?}", plans.snakes), "3, 6 and 10"));
        }
        if plans.modes.is_empty() {
            return Err(check.range("plans.modes", "empty", "\"step\" and \"fly\""));
        }
        check.list(
            "plans.speeds_deg_s",
            &plans.speeds_deg_s,
            |n| (10..=360).contains(&n),
            "10 … 360",
        )?;
        check.list("pca.readings", &raw.pca.readings, |n| n > 0, "1 …")?;
        let RawCompare {
            pairs,
            theta_max_deg,
            seed,
        } = raw.compare;
        let good = (1..=1_000_000).contains(&pairs);
        check.number("compare.pairs", pairs, good, "1 … 1e6")?;
        let good = theta_max_deg > 0.0 && theta_max_deg <= 90.0;
        check.number("compare.theta_max_deg", theta_max_deg, good, "above 0 … 90")?;
        let (readings, arcs) = (thin(plans.readings, quick), thin(plans.arc, quick));
        let mut cells = Vec::new();
        let motions: Vec<(Mode, u32)> = plans
            .modes
            .iter()
            .flat_map(|&mode| plans.speeds_deg_s.iter().map(move |&speed| (mode, speed)))
            .collect();
        for &(mode, speed_deg_s) in &motions {
            let cell = |planes_deg: &[f64], snake, readings, arc| GridPlan {
                planes_deg: planes_deg.to_vec(),
                snake,
                readings,
                distribution: plans.distribution,
                arc,
                mode,
                speed_deg_s,
                budget_s: None,
            };
            for planes_deg in &plans.planes_deg {
                for &readings in &readings {
                    cells.extend(arcs.iter().map(|&arc| cell(planes_deg, 0, readings, arc)));
                }
            }
            // Where the arms stop for each reading a snake is only slower than planes.
            if mode == Mode::Fly {
                cells.extend(plans.snakes.iter().map(|&legs| cell(&[], legs, 0, 0)));
            }
        }
        for cell in &cells {
            cell.job()?;
        }
        if let Some(adaptive) = raw.adaptive {
            check.list("adaptive.budget_s", &adaptive.budget_s, |n| n > 0, "1 … 86400")?;
            for budget_s in thin(adaptive.budget_s, quick) {
                let plan = GridPlan {
                    planes_deg: adaptive.planes_deg.clone(),
                    snake: 0,
                    readings: adaptive.readings,
                    distribution: plans.distribution,
                    arc: adaptive.arc,
                    mode: Mode::Step,
                    speed_deg_s: USUAL_DEG_S,
                    budget_s: Some(budget_s),
                };
                plan.job()?;
                cells.push(plan);
            }
        }
        Ok(Self {
            materials: materials.iter().step_by(every).cloned().collect(),
            known: materials,
            plans: cells,
            models: raw.models,
            pca: raw.pca.readings,
            draw: Draw {
                pairs: if quick { pairs.div_ceil(5) } else { pairs },
                theta_max: theta_max_deg.to_radians(),
                seed,
            },
        })
    }

    /// The sets of planes of which there is a floor, each once.
    pub(crate) fn sets(&self) -> Vec<&[f64]> {
        let mut sets: Vec<&[f64]> = Vec::new();
        for plan in self.fixed().filter(|plan| plan.snake == 0) {
            if !sets.contains(&plan.planes_deg.as_slice()) {
                sets.push(&plan.planes_deg);
            }
        }
        sets
    }

    /// The plans that are laid down before.
    pub(crate) fn fixed(&self) -> impl Iterator<Item = &GridPlan> {
        self.plans.iter().filter(|plan| plan.budget_s.is_none())
    }

    /// Reads a study file.
    ///
    /// # Errors
    /// The file cannot be read, or as for [`Grid::parse`].
    pub fn read(path: &Path, quick: bool) -> Result<Self, Error> {
        Self::parse(&crate::read(path)?, &path.display().to_string(), quick)
    }
}

/// Of a quick study the first, the middle and the last.
fn thin<T: Copy>(list: Vec<T>, quick: bool) -> Vec<T> {
    if !quick {
        return list;
    }
    let last = list.len() - 1;
    let mut at = vec![0, last / 2, last];
    at.dedup();
    at.into_iter().map(|i| list[i]).collect()
}
