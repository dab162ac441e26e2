use arms::Pose;

use crate::order::order;
use crate::reach::Reach;
use crate::route::{Standing, route};
use crate::targets::{Targets, arc, plane};
use crate::{Job, LeftOut, Mechanics, Plan, Step, Sweep, SweepError};

/// Gain steps of the photometer.
const GAINS: u8 = 3;
/// Dark readings at each gain and integration time: their mean is subtracted from every reading, so its noise must be
/// below that of one reading.
const DARK_REPEATS: usize = 4;

/// Plans a job on a rig.
///
/// First the dark readings, lamp off, where the arms stand: each gain at the shortest and the longest integration, so
/// that offset and rate can be fitted. Then the plane sweeps and the arc, in the order and direction with the least
/// time of motion from where the arms stand. Angles are whole steps of the servos.
///
/// # Errors
/// The arms stand outside the envelope; a sweep of which nothing can be measured on this rig, with its key and why.
pub fn plan(job: &Job, mechanics: &Mechanics) -> Result<Plan, SweepError> {
    let start = mechanics
        .start
        .map(|pose| Standing::measured(mechanics, pose))
        .transpose()?;
    let reach = Reach::new(mechanics, start.map(|start| start.pose));
    let mut sweeps: Vec<Targets> = (0..job.planes.len())
        .map(|index| plane(job, index, reach))
        .collect::<Result<_, _>>()?;
    if let Some(of) = &job.arc {
        sweeps.push(arc(job, of, reach)?);
    }
    sweeps.retain(|sweep| !sweep.poses.is_empty());
    let poses: Vec<Vec<Pose>> = sweeps.iter().map(|sweep| sweep.poses.clone()).collect();
    let order = order(mechanics, start, &poses);
    let first = order.first().map(|&(i, backwards)| {
        let pose = poses[i][if backwards { poses[i].len() - 1 } else { 0 }];
        Standing {
            pose,
            approached: false,
        }
    });
    let Some(start) = start.or(first) else {
        return Err(SweepError::Unreachable {
            file: job.name.clone(),
            key: "[[plane]]".to_owned(),
            why: "the job asks for no reading".to_owned(),
        });
    };

    let mut draft = Draft {
        mechanics,
        steps: Vec::new(),
        standing: start,
    };
    draft.dark();
    for (i, backwards) in order {
        let poses = &poses[i];
        let along = (0..poses.len()).map(|j| poses[if backwards { poses.len() - 1 - j } else { j }]);
        draft.sweep(&mut sweeps[i], along);
    }
    let left_out = sweeps.into_iter().flat_map(|sweep| sweep.left_out).collect();
    let plan = Plan {
        steps: draft.steps,
        left_out,
        overhead_s: mechanics.warm_up_s,
        open: false,
    };
    check(&plan, mechanics, start.pose)?;
    Ok(plan)
}

/// A plan in the making: its steps, and where the arms stand after them.
struct Draft<'a> {
    mechanics: &'a Mechanics,
    steps: Vec<Step>,
    standing: Standing,
}

impl Draft<'_> {
    /// All dark readings, where the arms stand.
    fn dark(&mut self) {
        for gain in 0..GAINS {
            for integration_us in self.mechanics.integration_us {
                for _ in 0..DARK_REPEATS {
                    let seconds = self.mechanics.settle_s
                        + f64::from(integration_us) * 1e-6
                        + self.mechanics.transaction_s;
                    self.push(
                        Sweep::Dark,
                        vec![self.standing.pose],
                        Some((gain, integration_us)),
                        seconds,
                    );
                }
            }
        }
    }

    /// A sweep along poses; what no safe way leads to is left out.
    fn sweep(&mut self, targets: &mut Targets, poses: impl Iterator<Item = Pose>) {
        let mut unreached = 0;
        for pose in poses {
            let Some(route) = route(self.mechanics, self.standing, pose) else {
                unreached += 1;
                continue;
            };
            let seconds = route.seconds
                + self.mechanics.settle_s
                + self.mechanics.integration_s()
                + self.mechanics.transaction_s;
            self.push(targets.sweep, route.path, None, seconds);
            self.standing = Standing {
                pose,
                approached: true,
            };
        }
        if unreached > 0 {
            targets.left_out.push(LeftOut {
                what: format!("{}, {unreached} poses", targets.sweep),
                why: "no safe way leads there from the pose before".to_owned(),
                readings: unreached,
            });
        }
    }

    fn push(&mut self, sweep: Sweep, path: Vec<Pose>, exposure: Option<(u8, u32)>, seconds: f64) {
        let lamp = sweep != Sweep::Dark;
        self.steps.push(Step {
            index: self.steps.len(),
            sweep,
            path,
            lamp,
            exposure,
            seconds,
        });
    }
}

/// Looks at every leg once more.
fn check(plan: &Plan, mechanics: &Mechanics, start: Pose) -> Result<(), SweepError> {
    let mut from = start;
    for step in &plan.steps {
        for &to in &step.path {
            let checked = mechanics.envelope.check_path(from, to);
            checked.map_err(|source| SweepError::Leg {
                step: step.index,
                source,
            })?;
            from = to;
        }
    }
    Ok(())
}
