use serde::{Deserialize, Serialize};

/// What would be done for a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct SweepView {
    /// "plane 0", "arc", "dark".
    pub sweep: String,
    /// Readings.
    pub readings: usize,
}

/// What the choice of exposures may make of a plan's time, seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
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

/// What a plan leaves out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
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
