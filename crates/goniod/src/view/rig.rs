use arms::Arm;
use rig::RigFile;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::FaultView;
use crate::JobId;

/// Live picture of the rig.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
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
    /// The fault that keeps the rig from moving until it is acknowledged.
    pub fault: Option<FaultView>,
    /// The job under way.
    pub job: Option<JobId>,
    /// Its run.
    pub run: Option<String>,
    /// How far it is.
    pub progress: Option<Progress>,
}

/// What the rig is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
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

impl From<capture::State> for Activity {
    fn from(state: capture::State) -> Self {
        match state {
            capture::State::Identifying => Self::Identifying,
            capture::State::Engaging => Self::Engaging,
            capture::State::WarmingUp => Self::WarmingUp,
            capture::State::Running => Self::Running,
            capture::State::Paused => Self::Paused,
            capture::State::Suspended => Self::Suspended,
            capture::State::ShuttingDown => Self::ShuttingDown,
        }
    }
}

/// One arm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
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

impl RigView {
    /// A rig of which nothing is known but its file.
    pub(crate) fn new(rig: &RigFile) -> Self {
        let arm = |arm: Arm| {
            let limits = rig.envelope.limits(arm);
            ArmView {
                measured_deg: None,
                goal_deg: None,
                moving: false,
                torque: false,
                min_deg: limits.min.deg(),
                max_deg: limits.max.deg(),
            }
        };
        Self {
            connected: false,
            trouble: None,
            activity: Activity::Idle,
            arms: Arm::BOTH.map(arm),
            separation_deg: rig.envelope.separation_rad.to_degrees(),
            can_pass: rig.envelope.can_pass,
            lamp: false,
            lamp_monitor: None,
            temperature_c: None,
            fault: None,
            job: None,
            run: None,
            progress: None,
        }
    }

    pub(crate) fn see(&mut self, snapshot: &rig::Snapshot) {
        for (arm, location) in self.arms.iter_mut().zip(&snapshot.arms) {
            arm.measured_deg = Some(location.measured.deg());
            arm.goal_deg = Some(location.goal.deg());
            arm.moving = location.moving;
            arm.torque = location.torque;
        }
        self.connected = true;
        self.trouble = None;
    }
}
