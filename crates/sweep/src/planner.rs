use arms::Pose;

use crate::leg::leg;
use crate::order::order;
use crate::pass::pass;
use crate::reach::Reach;
use crate::route::{Standing, route};
use crate::targets::{Targets, arc, plane};
use crate::{Job, LeftOut, Mechanics, Mode, Plan, Step, Sweep, SweepError, unread};

/// Gain steps of the photometer.
const GAINS: u8 = 3;
/// Dark readings at each gain and integration time: their mean is subtracted from every reading, so its noise must be
/// below that of one reading.
const DARK_REPEATS: usize = 4;

/// Plans a job on a rig.
///
/// First the dark readings, lamp off, where the arms stand: each gain at the shortest and the longest integration, so
/// that offset and rate can be fitted. A long job repeats them every now and then, and ends with a last set; where
/// visits to a reference pose follow the lamp, it begins and ends with one. Then the plane sweeps and the arc, in the order and direction with the least
/// time of motion from where the arms stand. Angles are whole steps of the servos. Of a job with a scene, readings that no
/// value in it is made of are left out.
///
/// In flight each sweep is passed once, or there and back where the job says so; then every pose is a step of both passes, and
/// what play and lateness add in one direction the other takes away. The first dark readings are taken on the way to it. A sweep
/// whose arms would not move alike is stepped, and the plan says so.
///
/// # Errors
/// The arms stand outside the envelope; a sweep of which nothing can be measured on this rig, with its key and why; a
/// budget that the sweeps of the job exceed.
pub fn plan(job: &Job, mechanics: &Mechanics) -> Result<Plan, SweepError> {
    let start = mechanics
        .start
        .map(|pose| Standing::measured(mechanics, pose))
        .transpose()?;
    let reach = Reach::new(mechanics, start.map(|start| start.pose));
    let mut sweeps: Vec<Targets> = (0..job.planes.len())
        .map(|index| plane(job, index, reach))
        .collect::<Result<_, _>>()?;
    for index in 0..job.legs.len() {
        sweeps.push(leg(job, index, reach)?);
    }
    if let Some(of) = &job.arc {
        sweeps.push(arc(job, of, reach)?);
    }
    sweeps.retain(|sweep| !sweep.poses.is_empty());
    if let Some(scene) = &job.scene {
        let whole = lay(job, mechanics, start, sweeps.clone())?;
        unread::cut(job, scene, &mut sweeps, &whole);
    }
    let mut plan = lay(job, mechanics, start, sweeps)?;
    plan.left_out.extend(job.scene.iter().flat_map(unread::channels));
    plan.open = job.until.is_some();
    let budget_s = job.until.and_then(|until| until.budget_s);
    match budget_s.filter(|&budget_s| plan.seconds() > budget_s) {
        Some(budget_s) => Err(SweepError::Unreachable {
            file: job.name.clone(),
            key: "sweep.budget_s".to_owned(),
            why: format!(
                "the first sweeps alone take {:.1} s, the budget is {budget_s} s",
                plan.seconds()
            ),
        }),
        None => Ok(plan),
    }
}

/// Puts the poses of sweeps in the order of least motion, between what every run needs.
fn lay(
    job: &Job,
    mechanics: &Mechanics,
    start: Option<Standing>,
    mut sweeps: Vec<Targets>,
) -> Result<Plan, SweepError> {
    let measured: Vec<usize> = (0..sweeps.len())
        .filter(|&i| !sweeps[i].poses.is_empty())
        .collect();
    let poses: Vec<Vec<Pose>> = measured.iter().map(|&i| sweeps[i].poses.clone()).collect();
    let flown: Vec<bool> = measured
        .iter()
        .map(|&i| job.mode == Mode::Fly && may_fly(mechanics, &mut sweeps[i]))
        .collect();
    let returns: Vec<bool> = flown.iter().map(|&flown| flown && job.passes == 2).collect();
    let order = order(mechanics, start, &poses, &returns);
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

    let mut draft = Draft::new(mechanics, start);
    match order.first() {
        // The arms need not wait for what has no light.
        Some(&(i, backwards)) if flown[i] && mechanics.reference.is_none() => {
            draft.dark_on_the_way(poses[i][if backwards { poses[i].len() - 1 } else { 0 }]);
        }
        _ => draft.dark(),
    }
    draft.visit_reference(&job.name)?;
    for (i, backwards) in order {
        let mut along = poses[i].clone();
        if backwards {
            along.reverse();
        }
        let sweep = &mut sweeps[measured[i]];
        match flown[i] {
            true => draft.fly(job, sweep, along)?,
            false => draft.sweep(&job.name, sweep, along.into_iter())?,
        }
    }
    if draft.dark_sets > 1 {
        draft.dark();
    }
    draft.visit_reference(&job.name)?;
    let left_out = sweeps.into_iter().flat_map(|sweep| sweep.left_out).collect();
    let plan = Plan {
        steps: draft.steps,
        left_out,
        overhead_s: mechanics.warm_up_s,
        closing_s: closing_s(mechanics),
        open: false,
    };
    check(&plan.steps, mechanics, start.pose)?;
    Ok(plan)
}

/// Whether a sweep can be flown. What it leaves out says where not, and else what flying costs.
pub(crate) fn may_fly(mechanics: &Mechanics, sweep: &mut Targets) -> bool {
    let may = mechanics.in_flight && pass(mechanics, &sweep.poses).is_some();
    let (what, why) = match may {
        false if !mechanics.in_flight => (
            "in flight",
            "the detector cannot be read while the arms move: they stop for each reading",
        ),
        true => (
            "a second exposure for faint colours",
            "in flight each reading has one, for its brightest colour",
        ),
        false => (
            "in flight",
            "its arms would not move alike, or not freely: they stop for each reading",
        ),
    };
    sweep.left_out.push(LeftOut {
        what: format!("{}, {what}", sweep.sweep),
        why: why.to_owned(),
        readings: 0,
        seconds: 0.0,
    });
    may
}

/// One reading that a calibration asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visit {
    /// What it belongs to.
    pub sweep: Sweep,
    /// Where; the nearest pose that the servos can take is visited.
    pub pose: Pose,
    /// Gain step and integration time in µs; `None`: ranged from the readings before.
    pub exposure: Option<(u8, u32)>,
}

/// Plans readings at given poses in a given order, between two sets of dark readings. `name` is what errors call it.
///
/// # Errors
/// The arms stand outside the envelope; a pose that cannot be reached or is in shadow.
pub fn visits(name: &str, visits: &[Visit], mechanics: &Mechanics) -> Result<Plan, SweepError> {
    let start = match mechanics.start {
        Some(pose) => Standing::measured(mechanics, pose)?,
        None => Standing {
            pose: visits
                .first()
                .map_or(Pose::default(), |visit| mechanics.nearest_pose(visit.pose)),
            approached: false,
        },
    };
    let reach = Reach::new(mechanics, Some(start.pose));
    let mut draft = Draft::new(mechanics, start);
    draft.dark();
    for visit in visits {
        let pose = mechanics.nearest_pose(visit.pose);
        let refuse = |why: String| SweepError::Unreachable {
            file: name.to_owned(),
            key: format!("light {:.1}°, sensor {:.1}°", pose.light.deg(), pose.sensor.deg()),
            why,
        };
        reach
            .check(pose)
            .map_err(|hindrance| refuse(reach.why(&hindrance)))?;
        let integration_s = match visit.exposure {
            Some((_, integration_us)) => f64::from(integration_us) * 1e-6,
            None => mechanics.integration_s(),
        };
        if !draft.go(visit.sweep, pose, visit.exposure, integration_s) {
            return Err(refuse("no safe way leads there".to_owned()));
        }
    }
    draft.dark();
    let plan = Plan {
        steps: draft.steps,
        left_out: Vec::new(),
        overhead_s: mechanics.warm_up_s,
        closing_s: closing_s(mechanics),
        open: false,
    };
    check(&plan.steps, mechanics, start.pose)?;
    Ok(plan)
}

/// A plan in the making: its steps, and where the arms stand after them.
pub(crate) struct Draft<'a> {
    mechanics: &'a Mechanics,
    steps: Vec<Step>,
    standing: Standing,
    /// Flights so far.
    passes: usize,
    /// Sets of dark readings so far.
    dark_sets: usize,
    /// Seconds since the last of them, and since the last visit to the reference pose.
    since_dark_s: f64,
    since_visit_s: f64,
    /// Whether the lamp must come on again, after dark readings that were not the first.
    cold: bool,
    /// Whether anything lit was read, which tells how bright the first reading of a sweep may be.
    lit: bool,
}

impl<'a> Draft<'a> {
    fn new(mechanics: &'a Mechanics, standing: Standing) -> Self {
        Self {
            mechanics,
            steps: Vec::new(),
            standing,
            passes: 0,
            dark_sets: 0,
            since_dark_s: 0.0,
            since_visit_s: 0.0,
            cold: false,
            lit: false,
        }
    }

    /// What goes on after the steps of a plan, whose first dark readings are among them.
    pub(crate) fn after(mechanics: &'a Mechanics, standing: Standing, steps: &[Step]) -> Self {
        let since = |sweep: Sweep| {
            let later = steps.iter().rev().take_while(|step| step.sweep != sweep);
            later.map(|step| step.seconds).sum()
        };
        Self {
            dark_sets: 1,
            lit: steps.iter().any(|step| step.lamp),
            passes: steps
                .iter()
                .filter_map(|step| step.pass)
                .max()
                .map_or(0, |last| last + 1),
            since_dark_s: since(Sweep::Dark),
            since_visit_s: since(Sweep::Reference),
            ..Self::new(mechanics, standing)
        }
    }

    /// The steps as they follow on those of a plan that ends at a pose, checked.
    pub(crate) fn added(mut self, to: &[Step], from: Pose) -> Result<Vec<Step>, SweepError> {
        for step in &mut self.steps {
            step.index += to.len();
        }
        check(&self.steps, self.mechanics, from)?;
        Ok(self.steps)
    }

    /// What is due before the next reading of a sweep.
    fn upkeep(&mut self, job: &str) -> Result<(), SweepError> {
        if self.mechanics.dark_every_s > 0.0 && self.since_dark_s >= self.mechanics.dark_every_s {
            self.dark();
        }
        match self.mechanics.reference {
            Some((_, every_s)) if self.since_visit_s >= every_s => self.visit_reference(job),
            _ => Ok(()),
        }
    }

    /// A reading at the reference pose, where there is one.
    pub(crate) fn visit_reference(&mut self, job: &str) -> Result<(), SweepError> {
        let Some((pose, _)) = self.mechanics.reference else {
            return Ok(());
        };
        if !self.go(Sweep::Reference, pose, None, self.mechanics.integration_s()) {
            return Err(SweepError::Unreachable {
                file: job.to_owned(),
                key: "the reference pose of the rig file".to_owned(),
                why: "no safe way leads there".to_owned(),
            });
        }
        self.since_visit_s = 0.0;
        Ok(())
    }

    /// One lit reading at a pose; false where no safe way leads there.
    fn go(&mut self, sweep: Sweep, pose: Pose, exposure: Option<(u8, u32)>, integration_s: f64) -> bool {
        let Some(route) = route(self.mechanics, self.standing, pose) else {
            return false;
        };
        let seconds = route.seconds + self.mechanics.rest_s() + integration_s + self.mechanics.transaction_s;
        self.push(sweep, route.path, exposure, None, seconds);
        self.standing = Standing {
            pose,
            approached: true,
        };
        true
    }

    /// All dark readings, where the arms stand.
    fn dark(&mut self) {
        self.cold = self.dark_sets > 0;
        self.dark_sets += 1;
        for exposure in darks(self.mechanics) {
            let seconds = self.mechanics.settle_s + self.dark_s(exposure);
            self.push(
                Sweep::Dark,
                vec![self.standing.pose],
                Some(exposure),
                None,
                seconds,
            );
        }
        self.since_dark_s = 0.0;
    }

    /// All dark readings, while the arms go to a pose; where they stand, if no safe way leads there.
    fn dark_on_the_way(&mut self, to: Pose) {
        let Some(route) = route(self.mechanics, self.standing, to) else {
            return self.dark();
        };
        self.dark_sets += 1;
        let mut path = route.path;
        let mut motion_s = route.seconds;
        for exposure in darks(self.mechanics) {
            let seconds = self.dark_s(exposure);
            motion_s -= seconds;
            let path = std::mem::replace(&mut path, vec![to]);
            self.push(Sweep::Dark, path, Some(exposure), Some(self.passes), seconds);
        }
        // What is left of the way comes after the last of them.
        if let Some(last) = self.steps.last_mut() {
            last.seconds += motion_s.max(0.0);
        }
        self.passes += 1;
        self.standing = Standing {
            pose: to,
            approached: true,
        };
        self.since_dark_s = 0.0;
    }

    /// Seconds of one dark reading, arms aside.
    fn dark_s(&self, (_, integration_us): (u8, u32)) -> f64 {
        f64::from(integration_us) * 1e-6 + self.mechanics.transaction_s
    }

    /// A sweep along poses; what no safe way leads to is left out.
    pub(crate) fn sweep(
        &mut self,
        job: &str,
        targets: &mut Targets,
        poses: impl Iterator<Item = Pose>,
    ) -> Result<(), SweepError> {
        let mut unreached = 0;
        for pose in poses {
            self.upkeep(job)?;
            if !self.go(targets.sweep, pose, None, self.mechanics.integration_s()) {
                unreached += 1;
            }
        }
        if unreached > 0 {
            targets.left_out.push(LeftOut {
                what: format!("{}, {unreached} poses", targets.sweep),
                why: "no safe way leads there from the pose before".to_owned(),
                readings: unreached,
                seconds: 0.0,
            });
        }
        Ok(())
    }

    /// A sweep in flight, once or there and back; left out where no safe way leads to it.
    pub(crate) fn fly(
        &mut self,
        job: &Job,
        targets: &mut Targets,
        mut poses: Vec<Pose>,
    ) -> Result<(), SweepError> {
        for _ in 0..job.passes {
            let first = !self.lit;
            self.upkeep(&job.name)?;
            let way = route(self.mechanics, self.standing, poses[0]);
            let (Some(route), Some(seconds)) = (way, self.pass_s(&poses, first)) else {
                targets.left_out.push(LeftOut {
                    what: format!("{}, a pass of {} poses", targets.sweep, poses.len()),
                    why: "no safe way leads there from the pose before".to_owned(),
                    readings: poses.len(),
                    seconds: 0.0,
                });
                continue;
            };
            let mut path = route.path;
            let mut to_first_s = route.seconds + self.mechanics.rest_s();
            for (&pose, seconds) in poses.iter().zip(seconds) {
                let path = match std::mem::take(&mut path) {
                    way if way.is_empty() => vec![pose],
                    way => way,
                };
                let seconds = seconds + std::mem::take(&mut to_first_s);
                self.push(targets.sweep, path, None, Some(self.passes), seconds);
            }
            self.passes += 1;
            self.standing = Standing {
                pose: poses[poses.len() - 1],
                approached: true,
            };
            poses.reverse();
        }
        Ok(())
    }

    /// Seconds from each pose of a pass to the next, with the reading that the first pass of a plan begins with at rest:
    /// nothing tells before how bright it is there. The arms then rest once more, at the second pose.
    fn pass_s(&self, poses: &[Pose], first: bool) -> Option<Vec<f64>> {
        let seconds = pass(self.mechanics, poses)?;
        // Of three poses the other two are not worth a pass, but flown all the same.
        let Some(flown) = pass(self.mechanics, &poses[1..]).filter(|_| first) else {
            return Some(seconds);
        };
        let mut seconds = [
            &[self.mechanics.integration_s() + self.mechanics.transaction_s],
            &flown[..],
        ]
        .concat();
        seconds[1] += self.mechanics.leg_s(poses[0], poses[1]) + self.mechanics.rest_s();
        Some(seconds)
    }

    fn push(
        &mut self,
        sweep: Sweep,
        path: Vec<Pose>,
        exposure: Option<(u8, u32)>,
        pass: Option<usize>,
        seconds: f64,
    ) {
        let lamp = sweep != Sweep::Dark;
        self.lit |= lamp;
        let seconds = match lamp && std::mem::take(&mut self.cold) {
            true => seconds + self.mechanics.warm_up_s,
            false => seconds,
        };
        self.since_dark_s += seconds;
        self.since_visit_s += seconds;
        self.steps.push(Step {
            index: self.steps.len(),
            sweep,
            path,
            lamp,
            exposure,
            pass,
            seconds,
        });
    }
}

/// Gain step and integration time of each dark reading of a set.
fn darks(mechanics: &Mechanics) -> impl Iterator<Item = (u8, u32)> + use<> {
    let integration_us = mechanics.integration_us;
    (0..GAINS)
        .flat_map(move |gain| integration_us.map(|us| (gain, us)))
        .flat_map(|exposure| [exposure; DARK_REPEATS])
}

/// Seconds of the last look at the dark: one of the longest exposures, where the arms stand.
fn closing_s(mechanics: &Mechanics) -> f64 {
    let [_, longest_us] = mechanics.integration_us;
    f64::from(longest_us) * 1e-6 + mechanics.transaction_s
}

/// Looks at every leg once more.
fn check(steps: &[Step], mechanics: &Mechanics, start: Pose) -> Result<(), SweepError> {
    let mut from = start;
    for step in steps {
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
