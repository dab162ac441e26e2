use arms::Pose;
use serde::{Deserialize, Serialize};

/// The part of a capture to which a step belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sweep {
    /// Lamp off.
    Dark,
    /// A plane sweep, by its index in the job.
    Plane(usize),
    /// A line along which both arms move, by its index in the job.
    Leg(usize),
    /// The mirror arc.
    Arc,
    /// A visit to the reference pose, or to a standard in a calibration.
    Reference,
    /// A pose that was measured before.
    Repeat,
}

impl Sweep {
    /// Whether it runs over the half angle: a plane or a leg.
    pub fn is_curve(self) -> bool {
        matches!(self, Self::Plane(_) | Self::Leg(_))
    }

    /// Whether its readings make the model: a curve, or the arc.
    pub fn is_measured(self) -> bool {
        self.is_curve() || self == Self::Arc
    }
}

impl std::fmt::Display for Sweep {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Dark => f.write_str("dark"),
            Self::Plane(index) => write!(f, "plane {index}"),
            Self::Leg(index) => write!(f, "leg {index}"),
            Self::Arc => f.write_str("arc"),
            Self::Reference => f.write_str("reference"),
            Self::Repeat => f.write_str("repeat"),
        }
    }
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
    /// The flight to which it belongs: readings that the arms pass without a stop, or dark ones on their way to the pose;
    /// `None`: they rest for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pass: Option<usize>,
    /// Estimated seconds of motion, settling and integration.
    pub seconds: f64,
}

impl Step {
    /// Where the reading is taken.
    ///
    /// # Panics
    /// If the path is empty, which it is in no plan.
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
    /// How many of the readings that the job asks for are not taken because of it; 0 where they went to the rest of
    /// the sweep.
    pub readings: usize,
    /// Seconds that this saves, as planned; 0 where nothing of it could have been measured.
    #[serde(default)]
    pub seconds: f64,
}

/// The ordered list of readings that a job becomes, with its time and what was left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Steps in the order in which they are taken.
    pub steps: Vec<Step>,
    /// What was left out and why.
    pub left_out: Vec<LeftOut>,
    /// Seconds between the steps: warm-up of the lamp.
    pub overhead_s: f64,
    /// Seconds of the last look at the dark, after the last step.
    #[serde(default)]
    pub closing_s: f64,
    /// Whether further steps may be added once these are done.
    #[serde(default)]
    pub open: bool,
}

impl Plan {
    /// Estimated seconds of rig time.
    pub fn seconds(&self) -> f64 {
        self.overhead_s + self.closing_s + self.steps.iter().map(|step| step.seconds).sum::<f64>()
    }
}
