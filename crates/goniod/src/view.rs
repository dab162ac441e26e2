use std::path::PathBuf;

use arms::Arm;
use report::Measurement;
use rig::RigFile;
use serde::{Deserialize, Serialize};
use sweep::{Light, Plan};
use utoipa::ToSchema;

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

/// A fault, latched until someone acknowledges it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct FaultView {
    /// Its code, which docs/operating.md explains.
    pub code: FaultCode,
    /// What happened, with its causes.
    pub text: String,
    /// When, RFC 3339, UTC.
    pub at: String,
    /// The run that it ended.
    pub run: Option<String>,
}

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FaultCode {
    /// Someone pressed the emergency stop.
    Estop,
    /// A device gives no good reply.
    NoReply,
    /// A device refused a request, or a motion would leave the envelope.
    Refused,
    /// A device reports a hardware error.
    Hardware,
    /// An arm did not do what it was told.
    Motion,
    /// The port is gone.
    Disconnected,
    /// A device is not what the rig file, or the run, says.
    Mismatch,
    /// The rig file, or its port, cannot be used.
    Setup,
    /// The disk is full.
    DiskFull,
    /// Another program keeps the store locked.
    StoreLocked,
    /// The store may not be written.
    ReadOnly,
    /// The disk, or its file system, refuses for a reason of its own.
    DiskError,
    /// The store cannot be read or written for another reason, such as damage.
    Store,
    /// Results cannot be written.
    Report,
}

impl From<rig::FaultKind> for FaultCode {
    fn from(kind: rig::FaultKind) -> Self {
        use rig::FaultKind as Kind;
        match kind {
            Kind::NoReply => Self::NoReply,
            Kind::Refused => Self::Refused,
            Kind::Hardware => Self::Hardware,
            Kind::Motion => Self::Motion,
            Kind::Disconnected => Self::Disconnected,
            Kind::Mismatch => Self::Mismatch,
            _ => Self::Setup,
        }
    }
}

/// A run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct RunView {
    /// Its id, never reused.
    pub id: String,
    /// The job that it executes.
    pub job: JobId,
    /// What messages call the job's file.
    pub name: String,
    /// What was measured, in the technician's words.
    pub specimen: String,
    /// Where its files are.
    #[schema(value_type = String)]
    pub directory: PathBuf,
    /// When it began, RFC 3339, UTC.
    pub started: String,
    /// When its files were written last, RFC 3339, UTC; `None` before.
    pub reported: Option<String>,
    /// Steps of its plan.
    pub planned: u64,
    /// Steps with an accepted reading.
    pub accepted: u64,
}

/// A reading with what follows from it.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct ReadingView {
    /// Index of its step in the plan.
    pub step: usize,
    /// Exposures of this step before this one.
    pub attempt: u32,
    /// Whether it counts for its step.
    pub accepted: bool,
    /// What it belongs to: "plane 0", "arc", "dark", "repeat".
    pub sweep: String,
    /// Whether the lamp was on.
    pub lamp: bool,
    /// Light arm, measured, degrees.
    pub light_deg: f64,
    /// Sensor arm, measured, degrees.
    pub sensor_deg: f64,
    /// Zenith angle of the sensor, degrees.
    pub theta_r_deg: f64,
    /// Signed deviation from the mirror direction: |·| is d_p, positive towards the normal.
    pub deviation: f64,
    /// Counts of red, green, blue.
    pub counts: [u32; 3],
    /// Counts of the lamp monitor.
    pub monitor: u32,
    /// Gain factor.
    pub gain: u16,
    /// Integration time, µs.
    pub integration_us: u32,
    /// Temperature of the photometer, °C.
    pub temperature_c: u8,
    /// BRDF in sr⁻¹, red, green, blue, where the counts tell it.
    pub f: Option<[f64; 3]>,
    /// What to know about it.
    pub flags: Vec<String>,
    /// Seconds of rig time since the run began.
    pub time_s: f64,
}

impl From<&Measurement> for ReadingView {
    fn from(measurement: &Measurement) -> Self {
        let reading = &measurement.reading;
        let counts = &reading.counts;
        Self {
            step: reading.step,
            attempt: reading.attempt,
            accepted: reading.accepted,
            sweep: reading.sweep.to_string(),
            lamp: reading.lamp,
            light_deg: reading.measured.light.deg(),
            sensor_deg: reading.measured.sensor.deg(),
            theta_r_deg: measurement.theta_r.to_degrees(),
            deviation: measurement.deviation,
            counts: counts.rgb,
            monitor: counts.monitor,
            gain: counts.exposure.gain.into(),
            integration_us: counts.exposure.integration_us,
            temperature_c: counts.temperature_c,
            f: measurement.rgb().map(|rgb| rgb.to_array()),
            flags: reading
                .flags
                .iter()
                .map(|&flag| report::flag_name(flag).to_owned())
                .collect(),
            time_s: measurement.time_s,
        }
    }
}

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
