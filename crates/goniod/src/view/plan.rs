use serde::Serialize;
use sweep::{Light, Plan};
use utoipa::ToSchema;

/// What would be done for a job.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct PlanView {
    /// Readings.
    pub readings: usize,
    /// Seconds of rig time.
    pub seconds: f64,
    /// Readings by sweep, in the order in which they are taken.
    pub sweeps: Vec<SweepView>,
    /// What the choice of exposures may make of the seconds.
    pub light: LightView,
    /// What is left out and why.
    pub left_out: Vec<LeftOutView>,
    /// Whether more may be added on the way, by what the readings say: then readings and seconds are those of the first
    /// sweeps, and a job's `budget_s` is the most that the run takes.
    pub open: bool,
}

/// Part of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct SweepView {
    /// "plane 0", "arc", "dark".
    pub sweep: String,
    /// Readings.
    pub readings: usize,
}

/// What the choice of exposures may make of a plan's time, seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct LightView {
    /// Readings whose exposure is chosen on the way.
    pub readings: usize,
    /// Integration as planned; in flight with what the bus needs between two.
    pub foreseen_s: f64,
    /// The same if the shortest integration did for every reading.
    pub least_s: f64,
    /// The same if every reading took the longest.
    pub most_s: f64,
    /// What another exposure of one reading, saturated or too dim the first time, is expected to add.
    pub again_s: f64,
    /// The whole plan if every reading were exposed as often as may be, for the longest time.
    pub worst_s: f64,
}

impl From<Light> for LightView {
    fn from(light: Light) -> Self {
        Self {
            readings: light.readings,
            foreseen_s: light.foreseen_s,
            least_s: light.least_s,
            most_s: light.most_s,
            again_s: light.again_s,
            worst_s: light.worst_s,
        }
    }
}

/// What a plan leaves out.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct LeftOutView {
    /// What.
    pub what: String,
    /// Why.
    pub why: String,
    /// Readings that are not taken because of it.
    pub readings: usize,
    /// Seconds that this saves, as planned.
    pub seconds: f64,
}

impl PlanView {
    /// Of a plan and its light.
    pub(crate) fn new(plan: &Plan, light: Light) -> Self {
        let mut sweeps: Vec<SweepView> = Vec::new();
        for step in &plan.steps {
            let sweep = step.sweep.to_string();
            match sweeps.iter_mut().find(|known| known.sweep == sweep) {
                Some(known) => known.readings += 1,
                None => sweeps.push(SweepView { sweep, readings: 1 }),
            }
        }
        let left_out = plan.left_out.iter().map(|left| LeftOutView {
            what: left.what.clone(),
            why: left.why.clone(),
            readings: left.readings,
            seconds: left.seconds,
        });
        Self {
            readings: plan.steps.len(),
            seconds: plan.seconds(),
            sweeps,
            light: light.into(),
            left_out: left_out.collect(),
            open: plan.open,
        }
    }
}
