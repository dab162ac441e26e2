use capture::{Extension, Record, extended_plan};
use pdv::Expectation;
use rig::RigFile;
use serde::Serialize;
use sweep::{Addition, Job, MAX_PLANES, Plan, Step, Sweep, THETA_R_DEG, Until};

use crate::derive::Sweeps;
use crate::{Run, measurements};

/// A gain below this share of the expected error is none: readings more would buy nothing that could be told.
const LEAST_GAIN: f64 = 0.01;
/// Planes are no closer than this, rad: nearer ones would say nothing new.
const CLOSEST: f64 = 0.07;

/// How a run that stops when good enough came to its end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Adapted {
    /// MALE that was expected when it was looked at last, over what the job asks for.
    pub expected_male: Option<f64>,
    /// What was added and why, in words.
    pub added: Vec<String>,
    /// Why nothing more was, in words; `None` where the run has not come so far.
    pub stopped: Option<String>,
}

impl Adapted {
    /// What a journal tells of it; `None` of a run whose plan is not open.
    pub fn new(records: &[Record]) -> Option<Self> {
        let open = matches!(records.first(), Some(Record::Header(header)) if header.plan.open);
        let mut adapted = open.then_some(Self {
            expected_male: None,
            added: Vec::new(),
            stopped: None,
        })?;
        for record in records {
            let Record::Extension(extension) = record else {
                continue;
            };
            adapted.expected_male = extension.expected_male.or(adapted.expected_male);
            match extension.steps.is_empty() {
                true => adapted.stopped = Some(extension.why.clone()),
                false => adapted.added.push(extension.why.clone()),
            }
        }
        Some(adapted)
    }
}

/// What a run of a job is to measure next, from its journal alone: the same whenever it is asked. Without steps
/// it is the end: at the job's target, its budget, or where nothing gains.
pub fn extension(job: &Job, records: &[Record], rig: &RigFile) -> Extension {
    decide(job, records, rig).unwrap_or_else(|why| Extension {
        steps: Vec::new(),
        why: format!("nothing is added: {why}"),
        expected_male: None,
    })
}

fn decide(job: &Job, records: &[Record], rig: &RigFile) -> Result<Extension, String> {
    let (Some(plan), Some(Record::Header(header))) = (extended_plan(records), records.first()) else {
        return Err("the journal has no header".to_owned());
    };
    let until = job.until.ok_or("the job names no target and no budget")?;
    let grown = job.grown(&plan);
    let sweeps = Sweeps::new(&grown, &measurements(records, rig));
    let expected = Expectation::new(&sweeps.planes, &sweeps.arc, job.scene.as_ref())
        .map_err(|error| error.to_string())?;
    let male = expected.male;
    let end = |why: String| Extension {
        steps: Vec::new(),
        why,
        expected_male: Some(male),
    };
    if let Some(target) = until.target_male.filter(|&target| male <= target) {
        return Ok(end(format!(
            "the target is reached: an error of {male:.5} is expected, {target} is enough"
        )));
    }
    let run = Run::new(header, records);
    let clock = Clock {
        elapsed_s: run.seconds.total,
        // What is planned may be off by what exposures take.
        pace: (run.seconds.total / plan.seconds()).clamp(0.5, 2.0),
    };
    let worthwhile: Vec<Offer> = offers(&grown, &plan, &expected, rig)
        .into_iter()
        .filter(|offer| offer.gain > LEAST_GAIN * male)
        .collect();
    if worthwhile.is_empty() {
        return Ok(end(format!(
            "the floor of the model is reached: an error of {male:.5} is expected, and no further reading is expected to lower it by {} %",
            100.0 * LEAST_GAIN
        )));
    }
    let best = worthwhile
        .into_iter()
        .filter(|offer| clock.allows(until, offer.seconds()))
        .max_by(|a, b| a.rate().total_cmp(&b.rate()));
    Ok(match best {
        Some(best) => Extension {
            why: format!(
                "{}: {} readings in {:.1} s are worth most: they may change the result by {:.5}, and an error of {male:.5} is expected",
                best.name,
                best.steps.len(),
                best.seconds() * clock.pace,
                best.gain
            ),
            steps: best.steps,
            expected_male: Some(male),
        },
        None => end(format!(
            "the budget is spent: {:.1} s of {} s are over, and what would gain takes longer than the rest; an error of {male:.5} is expected",
            clock.elapsed_s,
            until.budget_s.unwrap_or_default()
        )),
    })
}

/// Rig time of a run.
struct Clock {
    elapsed_s: f64,
    /// Seconds that passed for each planned one.
    pace: f64,
}

impl Clock {
    fn allows(&self, until: Until, seconds: f64) -> bool {
        until
            .budget_s
            .is_none_or(|budget| self.elapsed_s + self.pace * seconds <= budget)
    }
}

/// Readings that could be added.
struct Offer {
    name: String,
    gain: f64,
    steps: Vec<Step>,
}

impl Offer {
    /// Of travel, settling and exposure, as planned.
    fn seconds(&self) -> f64 {
        self.steps.iter().map(|step| step.seconds).sum()
    }

    fn rate(&self) -> f64 {
        self.gain / self.seconds().max(f64::MIN_POSITIVE)
    }
}

/// Everything that could be added to a plan: a plane in every gap, readings between those of each plane and of the arc.
fn offers(job: &Job, plan: &Plan, expected: &Expectation, rig: &RigFile) -> Vec<Offer> {
    let mechanics = capture::mechanics(rig, None);
    let offer = |name: String, gain: f64, addition: Addition| {
        // What the rig cannot do is not on offer.
        let steps = sweep::add(job, plan, addition, &mechanics).ok()?;
        (!steps.is_empty()).then_some(Offer { name, gain, steps })
    };
    let far = |theta_r: f64| {
        job.planes
            .iter()
            .all(|plane| (plane.theta_r - theta_r).abs() > CLOSEST)
    };
    let worth = &expected.worth;
    let planes = worth
        .planes
        .iter()
        .map(|&(theta_r, gain)| (theta_r.min(THETA_R_DEG.end().to_radians()), gain))
        .filter(|&(theta_r, _)| job.planes.len() < MAX_PLANES && far(theta_r))
        .filter_map(|(theta_r, gain)| {
            let name = format!("a plane at {:.1}°", theta_r.to_degrees());
            offer(name, gain, Addition::Plane(theta_r))
        });
    let readings = worth.readings.iter().enumerate().filter_map(|(n, &gain)| {
        let name = format!("more of the plane at {:.1}°", job.planes[n].theta_r.to_degrees());
        offer(name, gain, Addition::Between(Sweep::Plane(n)))
    });
    let arc = offer(
        "more of the arc".to_owned(),
        worth.arc,
        Addition::Between(Sweep::Arc),
    );
    planes.chain(readings).chain(arc).collect()
}
