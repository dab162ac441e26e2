use arms::{Envelope, Pose, Profile};
use serde::{Deserialize, Serialize};

/// The part of a capture to which a step belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sweep {
    /// Lamp off.
    Dark,
    /// A plane sweep, by its index in the job.
    Plane(usize),
    /// The mirror arc.
    Arc,
    /// A visit to the white reference.
    Reference,
    /// A pose that was measured before.
    Repeat,
}

/// One reading to be taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Place in the plan, from 0; the checkpoint of a run.
    pub index: usize,
    /// What it belongs to.
    pub sweep: Sweep,
    /// Poses to pass on the way, then the pose of the reading; each leg was checked against the envelope.
    pub path: Vec<Pose>,
    /// Whether the lamp is on.
    pub lamp: bool,
    /// Gain step (0, 1, 2) and integration time in µs that the reading must have; `None`: ranged from the readings
    /// before. Dark readings are fixed.
    pub exposure: Option<(u8, u32)>,
    /// Estimated seconds of motion, settling and integration.
    pub seconds: f64,
}

impl Step {
    /// Where the reading is taken.
    pub fn pose(&self) -> Pose {
        *self.path.last().expect("a step's path ends at its pose")
    }
}

/// Something that a job could have asked for and the plan does not do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// What, in a few words: "plane 70°, light 65.0° … 75.0°".
    pub what: String,
    /// Why: "arms closer than 5.0°".
    pub why: String,
    /// How many readings that would have been.
    pub readings: usize,
}

/// The ordered list of readings that a job becomes, with its time and what was left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Steps in the order in which they are taken.
    pub steps: Vec<Step>,
    /// What was left out and why.
    pub left_out: Vec<LeftOut>,
    /// Seconds before the first step and after the last: warm-up of the lamp.
    pub overhead_s: f64,
}

impl Plan {
    /// Estimated seconds of rig time.
    pub fn seconds(&self) -> f64 {
        self.overhead_s + self.steps.iter().map(|step| step.seconds).sum::<f64>()
    }
}

/// What a plan needs to know of the rig: where the arms may go and how fast, and how long a reading takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mechanics {
    /// Limits and separation.
    pub envelope: Envelope,
    /// Profiles of light and sensor arm.
    pub profiles: [Profile; 2],
    /// Smallest step of each arm, rad.
    pub resolution_rad: [f64; 2],
    /// +1 / −1: side from which the last approach comes (towards larger / smaller angles); 0: either.
    pub approach: i8,
    /// How far a motion from the wrong side goes beyond, rad.
    pub overshoot_rad: f64,
    /// Settling before each reading, s.
    pub settle_s: f64,
    /// Shortest and longest integration, µs.
    pub integration_us: [u32; 2],
    /// Expected time on the bus and on the host for each reading, s.
    pub transaction_s: f64,
    /// Lamp warm-up, s.
    pub warm_up_s: f64,
    /// Where the arms stand before the run; `None`: not known yet, then the plan's first leg is not timed or checked.
    pub start: Option<Pose>,
}
