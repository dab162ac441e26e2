use std::path::{Path, PathBuf};
use std::time::Duration;

use arms::{Arm, ArmAngle, Envelope, Pose, Profile};

use crate::dynamixel::Model;
use crate::{Axis, Calibration, Lamp, RigError};

mod check;
mod detector;
mod raw;
mod source;

#[cfg(test)]
mod tests;

pub(crate) use detector::CONNECTION;
pub use detector::{Abilities, DetectorKind, DetectorSettings, LampControl};

/// The rig file, checked: what the rig is and where it may move.
///
/// Every key, its unit, default and range stand in config/rig.toml, which is also the built-in default.
#[derive(Clone, Debug, PartialEq)]
pub struct RigFile {
    /// What the rig is called.
    pub about: About,
    /// The serial bus.
    pub bus: BusSettings,
    /// Light and sensor arm, in this order.
    pub arms: [ArmSettings; 2],
    /// Limits and separation.
    pub envelope: Envelope,
    /// How arms move and settle.
    pub motion: MotionSettings,
    /// What counts the light.
    pub detector: DetectorSettings,
    /// Its exposures.
    pub photometer: PhotometerSettings,
    /// From counts to reflectance.
    pub calibration: Calibration,
    /// What is repeated during a run.
    pub visits: Visits,
    /// Stored calibrations.
    pub certificates: Certificates,
    /// When a run holds by itself.
    pub suspend: Suspend,
    /// What is known of the uncertainties.
    pub uncertainty: Uncertainties,
    /// The `[sim]` table, parsed by the simulator alone.
    pub sim: toml::Table,
    /// SHA-256, hexadecimal, of everything in the file that a calibration depends on: arms, photometer, filling and
    /// constants, with the defaults filled in.
    pub fingerprint: String,
}

/// `[rig]`: what the rig is called and where it stands, for the record of each run; empty where nothing is said.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// Its name.
    pub name: String,
    /// Its number in whatever list it stands.
    pub id: String,
    /// Where it stands.
    pub location: String,
}

/// `[suspend]`: when a run holds by itself, and goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suspend {
    /// Time between two looks.
    pub every: Duration,
    /// Temperature of any device, °C.
    pub temperature_c: Option<Band>,
    /// Supply of light and sensor servo, V.
    pub supply_v: [Option<Band>; 2],
    /// By how much the lamp monitor is off its nominal output, relative.
    pub lamp_rel: Option<Band>,
    /// Room where the readings are kept, bytes.
    pub disk_bytes: Option<Band>,
    /// Whether an open door holds.
    pub door: bool,
}

/// Two bounds of a value: beyond the first a run holds, and only within the second it goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Where it holds.
    pub hold: f64,
    /// Where it goes on.
    pub release: f64,
}

impl Band {
    /// Whether a value is one at which to hold, or to go on holding. Too low where the first bound is below the
    /// second, else too high; NaN is neither.
    pub fn holds(self, value: f64, holding: bool) -> bool {
        let bound = if holding { self.release } else { self.hold };
        match self.hold < self.release {
            true => value < bound,
            false => value > bound,
        }
    }
}

/// `[calibration]`: what is repeated during a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Visits {
    /// Time between two sets of dark readings; zero: at the start alone.
    pub dark_every: Duration,
    /// How the lamp's output is followed.
    pub lamp: Lamp,
    /// Time between two visits to the reference pose, where those follow the lamp.
    pub reference_every: Duration,
    /// The reference pose.
    pub reference: Pose,
}

/// `[calibration]`: stored calibrations.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificates {
    /// Whether a run needs a valid one; without, the constants of the rig file hold.
    pub required: bool,
    /// Where they are.
    pub directory: PathBuf,
    /// How old a part of one may be.
    pub max_age: Duration,
}

/// `[uncertainty]`: standard uncertainties of what no reading tells.
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertainties {
    /// Electrons per count at gain ×1; 0: no shot noise.
    pub electrons_per_count: f64,
    /// Of the converter, counts at any gain.
    pub read_noise_counts: f64,
    /// Of the rig file's responsivity, relative.
    pub responsivity: f64,
    /// Of a gain step above ×1, relative to its nominal factor, where no white reference was measured.
    pub gain: f64,
    /// Of the share of the counts that is lost at full scale, where no white reference was measured.
    pub nonlinearity: f64,
    /// Of the share of a colour channel's light that comes from the two other colours, where no colour patches were
    /// measured.
    pub crosstalk: f64,
    /// Of the stray light, as f·cos in sr⁻¹, where no black trap was measured.
    pub stray_per_sr: f64,
    /// Of each arm's angle from one reading to the next, rad.
    pub angle_rad: [f64; 2],
    /// Play that there may be between each arm and its encoder, rad of the arm; an arm lags behind its encoder by half of
    /// what there is.
    pub play_rad: [f64; 2],
    /// By how much an encoder errs where an arm stands for a sweep, rad.
    pub encoder_rad: f64,
    /// Of how a specimen lies, in the plane of the arms, rad.
    pub tilt_rad: f64,
    /// Of an arm's zero, rad, where no mirror was measured.
    pub zero_rad: f64,
    /// Half angles of source and detector as the specimen sees them, rad.
    pub apertures_rad: [f64; 2],
}

impl Uncertainties {
    /// How much further apart than the separation the arms must be while they are read, rad: twice the standard
    /// uncertainty of the angle between them, and half the play of both, by which they may lean towards each other. A mirror
    /// does not lower it, since it tells the sum of the zeros alone.
    pub fn shadow_margin_rad(&self) -> f64 {
        let arm = |angle_rad: f64| self.zero_rad.hypot(angle_rad).hypot(self.encoder_rad);
        let [light, sensor] = self.angle_rad.map(arm);
        2.0 * light.hypot(sensor) + self.play_rad.iter().sum::<f64>() / 2.0
    }
}

/// `[bus]`
#[derive(Clone, Debug, PartialEq)]
pub struct BusSettings {
    /// Where the bus is.
    pub port: Port,
    /// Baud rate.
    pub baud: u32,
    /// Worst latency of the adapter.
    pub latency: Duration,
    /// Whether the adapter echoes what is sent.
    pub echo: bool,
    /// A device that gives no good reply for so long is a fault.
    pub silence: Duration,
}

/// Where the bus is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Port {
    /// The built-in simulator.
    Sim,
    /// A serial device.
    Path(PathBuf),
}

/// `[light]` and `[sensor]`
#[derive(Clone, Debug, PartialEq)]
pub struct ArmSettings {
    /// Bus id.
    pub id: u8,
    /// Its model.
    pub model: &'static Model,
    /// Between counts and arm angle.
    pub axis: Axis,
    /// Speed and acceleration, already rounded to what the servo's registers can hold.
    pub profile: Profile,
    /// Return delay that the servo must be set to.
    pub return_delay: Duration,
}

/// `[motion]`
#[derive(Clone, Debug, PartialEq)]
pub struct MotionSettings {
    /// An arm that stands still within this of its goal has arrived, rad.
    pub near_rad: f64,
    /// An arm stands still whose measured angles lie within this over the settling time, rad.
    pub still_rad: f64,
    /// How long an arm must have stood still before a reading.
    pub settle: Duration,
    /// How much later than its profile says an arm is expected to stand: what plans count with. A run measures it.
    pub late: Duration,
    /// By how much a motion may overrun its profile.
    pub timeout: Duration,
    /// Direction of the last approach.
    pub approach: Approach,
    /// How far a motion from the wrong side goes beyond, rad.
    pub overshoot_rad: f64,
    /// Servo bus watchdog while engaged; zero leaves it off.
    pub watchdog: Duration,
    /// What an emergency stop does.
    pub estop: Estop,
    /// Where the arms rest.
    pub park: Pose,
    /// Whether they go there after each run that is done.
    pub park_between: bool,
}

/// Direction of the last approach to a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Approach {
    /// Whichever way the arm comes.
    None,
    /// Towards larger angles.
    Up,
    /// Towards smaller angles.
    Down,
}

/// What an emergency stop does with the arms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estop {
    /// Goal := present position.
    Hold,
    /// Torque off.
    Limp,
}

/// `[photometer]`
#[derive(Clone, Debug, PartialEq)]
pub struct PhotometerSettings {
    /// Bus id.
    pub id: u8,
    /// Shortest integration, µs.
    pub integration_min_us: u32,
    /// Longest integration, µs.
    pub integration_max_us: u32,
    /// Counts at which a channel is full.
    pub full_scale: u32,
    /// Share of full scale that an exposure aims at.
    pub aim: f64,
    /// Counts below which a reading is exposed again with more light.
    pub enough: u32,
    /// Noise that a reading in flight may have, relative.
    pub flight_noise_rel: f64,
    /// From lamp on to steady light.
    pub lamp_warm_up: Duration,
}

impl RigFile {
    /// Address of the detector, and name of the port, of the built-in simulator.
    pub const SIMULATED: &str = "sim";

    /// Text of the built-in rig file, the shipped config/rig.toml.
    pub const BUILT_IN: &str = include_str!("../../../config/rig.toml");

    /// Checks the text of a rig file; keys that it lacks are those of the built-in one. `name` is for the errors.
    ///
    /// # Errors
    /// No TOML, an unknown key, a wrong type, a value that is not allowed: with file, line and key.
    pub fn parse(text: &str, name: &Path) -> Result<Self, RigError> {
        check::file(&source::Source { text, name })
    }

    /// Reads and checks a rig file.
    ///
    /// # Errors
    /// The file cannot be read; else as [`RigFile::parse`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self, RigError> {
        let path = path.as_ref();
        let text = config::read_text(path).map_err(|source| RigError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text, path)
    }

    /// Settings of one arm.
    pub fn arm(&self, arm: Arm) -> &ArmSettings {
        &self.arms[arm as usize]
    }

    /// Whether one arm may shadow the other while they are read: at a pose, and in flight over all that each of them
    /// sweeps (rad) within the integration of which the pose is the middle, as far as the angles are known.
    pub fn shadowed(&self, pose: Pose, swept_rad: [f64; 2]) -> bool {
        let clearance = self.envelope.clearance_rad(pose, swept_rad);
        // NaN is nowhere.
        clearance.is_nan() || clearance < self.uncertainty.shadow_margin_rad()
    }

    /// By how much arms may stand outside the envelope without it being a fault, rad: twice what is near enough, since an
    /// arm may stand off its goal by as much, and give way a little more when nobody looks.
    pub fn slack_rad(&self) -> f64 {
        2.0 * self.motion.near_rad
    }

    /// The pose within the envelope that arms which stand at `pose` are taken to have: that itself, or where they stand
    /// outside by no more than the slack of each arm, the nearest within. Farther outside it is left as it is.
    pub fn admitted(&self, pose: Pose) -> Pose {
        let slack_rad = self.slack_rad();
        let mut within = pose;
        for arm in Arm::BOTH {
            let (angle, limits) = (pose.angle(arm), self.envelope.limits(arm));
            let nearest = angle.rad().clamp(limits.min.rad(), limits.max.rad());
            if (nearest - angle.rad()).abs() > slack_rad {
                return pose;
            }
            within = within.with(arm, ArmAngle::from_rad(nearest));
        }
        // A hair more, so that rounding does not leave them too close.
        let lacking = self.envelope.separation_rad - within.separation_rad() + 1e-9;
        if self.envelope.can_pass || lacking <= 1e-9 || lacking > 2.0 * slack_rad {
            return within;
        }
        let apart = (within.sensor - within.light).signum();
        let moved = |arm: Arm, sign: f64| {
            let angle = ArmAngle::from_rad(within.angle(arm).rad() + sign * apart * lacking);
            within.with(arm, angle)
        };
        [moved(Arm::Sensor, 1.0), moved(Arm::Light, -1.0)]
            .into_iter()
            .find(|&pose| self.envelope.check_pose(pose).is_ok())
            .unwrap_or(within)
    }

    /// The pose nearest to `pose` that the servos can be told to take: whole counts.
    pub fn nearest(&self, pose: Pose) -> Pose {
        let nearest = |arm: Arm| -> ArmAngle { self.arm(arm).axis.nearest(pose.angle(arm)) };
        Pose {
            light: nearest(Arm::Light),
            sensor: nearest(Arm::Sensor),
        }
    }
}

/// The built-in rig: the shipped config/rig.toml.
impl Default for RigFile {
    fn default() -> Self {
        Self::parse("", Path::new("built-in rig file")).expect("the shipped rig file is tested")
    }
}
