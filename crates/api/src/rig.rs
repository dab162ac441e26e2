use serde::{Deserialize, Serialize};

use crate::{FaultView, JobId};

/// Live picture of the rig.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RigView {
    /// Whether the devices answered when they were asked last.
    pub connected: bool,
    /// What keeps them from answering, where they do not.
    pub trouble: Option<String>,
    /// What the rig is doing.
    pub activity: Activity,
    /// Light and sensor arm.
    pub arms: [ArmView; 2],
    /// Closer than this the arms shadow each other, degrees.
    pub separation_deg: f64,
    /// Whether the arms clear each other; otherwise the zone within the separation is forbidden.
    pub can_pass: bool,
    /// Whether the lamp is on.
    pub lamp: bool,
    /// Lamp output that the monitor saw last, relative to nominal.
    pub lamp_monitor: Option<f64>,
    /// Temperature of the photometer at the last reading, °C.
    pub temperature_c: Option<u8>,
    /// The newest fault that keeps the rig from moving until it is acknowledged by its id.
    pub fault: Option<FaultView>,
    /// Why no job starts by itself: a latched fault, or a stop since which no operator has started a job.
    pub queue_held: Option<String>,
    /// The job under way.
    pub job: Option<JobId>,
    /// Its run.
    pub run: Option<String>,
    /// How far it is.
    pub progress: Option<Progress>,
}

/// What the rig is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Activity {
    /// Nothing; arms at rest, lamp off.
    Idle,
    /// Asking every device who it is.
    Identifying,
    /// Torque on, goals at the present position.
    Engaging,
    /// The lamp is on and not yet steady.
    WarmingUp,
    /// Moving and reading.
    Running,
    /// Holding, on an operator's wish.
    Paused,
    /// Holding, until something is as the rig file wants it.
    Suspended,
    /// Lamp off, arms come to rest.
    ShuttingDown,
    /// Writing what follows from the readings.
    Reporting,
    /// An arm is moved by hand, or both to rest.
    Moving,
}

impl std::fmt::Display for Activity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Idle => "idle",
            Self::Identifying => "identifying",
            Self::Engaging => "engaging",
            Self::WarmingUp => "warming up",
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Suspended => "suspended",
            Self::ShuttingDown => "shutting down",
            Self::Reporting => "reporting",
            Self::Moving => "moving",
        })
    }
}

/// One arm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ArmView {
    /// Where it was last seen, degrees from the normal, positive towards +x.
    pub measured_deg: Option<f64>,
    /// Where it was last told to go, degrees.
    pub goal_deg: Option<f64>,
    /// Whether it moves.
    pub moving: bool,
    /// Whether its motor holds it.
    pub torque: bool,
    /// Least angle allowed, degrees.
    pub min_deg: f64,
    /// Largest angle allowed, degrees.
    pub max_deg: f64,
}

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Progress {
    /// Steps with an accepted reading.
    pub done: usize,
    /// Steps of the plan.
    pub of: usize,
    /// Seconds of rig time still needed.
    pub seconds_left: f64,
    /// Requests on the bus that had to be repeated.
    pub retries: u32,
}
