use std::collections::HashSet;

use arms::{Arm, ArmAngle, Pose};
use pdv::Distribution;

use crate::order::order;
use crate::planner::{Draft, may_fly};
use crate::reach::Reach;
use crate::route::Standing;
use crate::targets::{Targets, plane};
use crate::{Job, Mechanics, Mode, Plan, Plane, Step, Sweep, SweepError, unread};

/// What may be added to a plan while it runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Addition {
    /// A plane at a new θ_r, rad, distributed as the job's first, with as many readings as the plane has that has most:
    /// a sparser one among denser ones would make values worse that were interpolated between those.
    Plane(f64),
    /// A reading between any two neighbours of a plane, by its index, or of the arc.
    Between(Sweep),
}

/// Plans an addition from where a plan ends: its steps, whose indices go on from the plan's. Empty where no new pose can
/// be measured.
///
/// # Errors
/// As [`crate::plan()`].
pub fn add(
    job: &Job,
    plan: &Plan,
    addition: Addition,
    mechanics: &Mechanics,
) -> Result<Vec<Step>, SweepError> {
    let Some(last) = plan.steps.last() else {
        return Ok(Vec::new());
    };
    let standing = Standing {
        pose: last.pose(),
        approached: true,
    };
    let reach = Reach::new(mechanics, Some(standing.pose));
    let mut targets = match addition {
        Addition::Plane(theta_r) => {
            let grown = job.grown(plan);
            let readings = (0..grown.planes.len()).map(|n| planned(plan, Sweep::Plane(n)));
            let most = readings.max().unwrap_or(1);
            let grown = grown.with_plane(theta_r, most);
            plane(&grown, grown.planes.len() - 1, reach)?
        }
        Addition::Between(sweep) => between(plan, sweep, reach),
    };
    if let Some(scene) = &job.scene {
        unread::cut_added(&job.grown(plan), scene, plan, &mut targets);
    }
    if targets.poses.is_empty() {
        return Ok(Vec::new());
    }
    let flown = job.mode == Mode::Fly && may_fly(mechanics, &mut targets);
    let poses = targets.poses.clone();
    let returns = flown && job.passes == 2;
    let backwards = order(
        mechanics,
        Some(standing),
        std::slice::from_ref(&poses),
        &[returns],
    )[0]
    .1;
    let mut draft = Draft::after(mechanics, standing, &plan.steps);
    let along = (0..poses.len()).map(|i| poses[if backwards { poses.len() - 1 - i } else { i }]);
    match flown {
        true => draft.fly(job, &mut targets, along.collect())?,
        false => draft.sweep(&job.name, &mut targets, along)?,
    }
    draft.visit_reference(&job.name)?;
    draft.added(&plan.steps, standing.pose)
}

/// Poses half-way between those that a plan has in a sweep.
fn between(plan: &Plan, sweep: Sweep, reach: Reach<'_>) -> Targets {
    let mechanics = reach.mechanics;
    // What the sweep moves: along the arc both arms, of which the sensor counts.
    let arm = if sweep == Sweep::Arc {
        Arm::Sensor
    } else {
        Arm::Light
    };
    let mut known: Vec<Pose> = plan
        .steps
        .iter()
        .filter(|step| step.sweep == sweep)
        .map(Step::pose)
        .collect();
    known.sort_by(|a, b| a.angle(arm).rad().total_cmp(&b.angle(arm).rad()));
    known.dedup();
    let middle = |pair: &[Pose]| {
        let half_way = |arm: Arm| {
            let [a, b] = [pair[0], pair[1]].map(|pose| pose.angle(arm).rad());
            ArmAngle::from_rad(0.5 * (a + b))
        };
        mechanics.nearest_pose(Pose {
            light: half_way(Arm::Light),
            sensor: half_way(Arm::Sensor),
        })
    };
    let poses = known
        .windows(2)
        .map(middle)
        .filter(|pose| !known.contains(pose) && reach.check(*pose).is_ok());
    Targets {
        sweep,
        poses: poses.collect(),
        left_out: Vec::new(),
    }
}

impl Job {
    /// The job with the planes that were added to its plan while it ran, in the order of their indices.
    #[must_use]
    pub fn grown(&self, plan: &Plan) -> Self {
        let mut grown = self.clone();
        while let Some(step) = plan
            .steps
            .iter()
            .find(|step| step.sweep == Sweep::Plane(grown.planes.len()))
        {
            grown = grown.with_plane(step.pose().sensor.rad().abs(), planned(plan, step.sweep));
        }
        grown
    }

    /// With one plane more, distributed as the first.
    fn with_plane(mut self, theta_r: f64, readings: usize) -> Self {
        let first = self.planes.first();
        let distribution = first.map_or(Distribution::Lobe, |plane| plane.distribution);
        self.planes.push(Plane {
            theta_r,
            readings,
            distribution,
        });
        self
    }
}

/// Poses that a plan has of a sweep: a flight may pass each of them twice.
fn planned(plan: &Plan, sweep: Sweep) -> usize {
    let steps = plan.steps.iter().filter(|step| step.sweep == sweep);
    let poses: HashSet<[u64; 2]> = steps
        .map(|step| [step.pose().light, step.pose().sensor].map(|angle| angle.rad().to_bits()))
        .collect();
    poses.len()
}
