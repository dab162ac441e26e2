use std::collections::VecDeque;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::MechanicsKeys;

/// Something that goes wrong with a device at a given moment of simulated time.
///
/// In TOML `{ device = "sensor", at_s = 3.5, what = { stall_s = 0.2 } }`; without `at_s` at once.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// Which device.
    pub device: rig::Device,
    /// When, since power-on; what lies in the past happens at once.
    #[serde(rename = "at_s", with = "seconds", default)]
    pub at: Duration,
    /// What.
    pub what: Disturbance,
}

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", from = "Spelling")]
#[non_exhaustive]
pub enum Disturbance {
    /// The device neither hears nor answers for so long; what it was doing goes on.
    #[serde(rename = "silence_s", with = "seconds")]
    Silence(Duration),
    /// Bits of Hardware Error Status, such as [`OVERLOAD`](Self::OVERLOAD), appear and stay until a reboot. Where the
    /// servo's Shutdown register names one of them torque goes off; any of them puts the photometer's lamp out.
    HardwareError(u8),
    /// The shaft of a servo is stuck for so long, while its profile goes on; the photometer's running integration
    /// takes so much longer.
    #[serde(rename = "stall_s", with = "seconds")]
    Stall(Duration),
    /// The photometer refuses the next trigger (Result Fail).
    RefusedTrigger,
    /// The photometer's next write is carried out and not acknowledged.
    LostAcknowledgement,
    /// The device's supply sags for a moment: it restarts, and its RAM is lost.
    Reboot,
    /// The bus watchdog trips although somebody spoke: a servo stands and refuses goals, the photometer's lamp goes
    /// out, until 0 is written to it.
    WatchdogTrip,
    /// The supply of a servo sinks to [`SAG_V`](Self::SAG_V) for so long; only Present Input Voltage shows it.
    #[serde(rename = "sag_s", with = "seconds")]
    Sag(Duration),
    /// So much light gets in from outside for so long that every channel is full.
    #[serde(rename = "glare_s", with = "seconds")]
    Glare(Duration),
    /// Light of the room reaches the photometer for so long, too little to fill a channel; beside that of the table
    /// `[sim]` and of other faults.
    RoomLight(RoomLight),
    /// The door at the photometer's contact is open for so long.
    #[serde(rename = "door_s", with = "seconds")]
    Door(Duration),
    /// The device answers under this id from now on, as one that was set up wrongly.
    Id(u8),
    /// Friction, gears, load or encoder of a servo become others from now on.
    Mechanics(MechanicsKeys),
    /// Somebody turns the arm of a servo that has no torque by so many degrees.
    #[serde(rename = "turn_deg")]
    Turn(f64),
}

/// Light that reaches the photometer whether the lamp is on or not, for a while. The lamp monitor does not see it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomLight {
    /// Its mean, as the f·cos that gives as much with the lamp at nominal output, sr⁻¹, 0 … 100.
    #[serde(deserialize_with = "level")]
    pub per_sr: f64,
    /// How often a second it swells to twice its mean and fades to nothing, Hz, 0 … 10000; 0: it is steady.
    #[serde(default, deserialize_with = "flicker")]
    pub flicker_hz: f64,
    /// For how long.
    #[serde(rename = "for_s", with = "seconds")]
    pub duration: Duration,
}

impl RoomLight {
    /// Brightest light, sr⁻¹.
    pub const MAX_PER_SR: f64 = 100.0;
    /// Fastest flicker, Hz.
    pub const MAX_FLICKER_HZ: f64 = 10_000.0;
}

fn level<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    within(from, "per_sr", RoomLight::MAX_PER_SR)
}

fn turn<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    let deg = f64::deserialize(from)?;
    match (-180.0..=180.0).contains(&deg) {
        true => Ok(deg),
        false => Err(serde::de::Error::custom(format!(
            "turn_deg is {deg}, allowed: -180 … 180"
        ))),
    }
}

fn flicker<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    within(from, "flicker_hz", RoomLight::MAX_FLICKER_HZ)
}

/// A number from 0 to a largest one; NaN is in no range.
fn within<'de, D: serde::Deserializer<'de>>(from: D, key: &str, max: f64) -> Result<f64, D::Error> {
    let value = f64::deserialize(from)?;
    match (0.0..=max).contains(&value) {
        true => Ok(value),
        false => Err(serde::de::Error::custom(format!(
            "{key} is {value}, allowed: 0 … {max}"
        ))),
    }
}

impl Disturbance {
    /// Supply voltage of a 12 V servo that sags, V: above the 9.5 V at which it complains. That of a model for another supply
    /// sags in proportion.
    pub const SAG_V: f64 = 10.0;
    /// Overload, which shuts a servo down.
    pub const OVERLOAD: Self = Self::HardwareError(1 << 5);
    /// Overheating, which shuts a servo down.
    pub const OVERHEATING: Self = Self::HardwareError(1 << 2);
    /// Supply voltage: a servo goes on with its Alert bit set.
    pub const ALERT: Self = Self::HardwareError(1);
}

/// How a file may spell what goes wrong: as it is written, and hardware errors by the names that they have by chance.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Spelling {
    #[serde(rename = "silence_s", with = "seconds")]
    Silence(Duration),
    HardwareError(u8),
    Overload,
    Overheating,
    Alert,
    #[serde(rename = "stall_s", with = "seconds")]
    Stall(Duration),
    RefusedTrigger,
    LostAcknowledgement,
    Reboot,
    WatchdogTrip,
    #[serde(rename = "sag_s", with = "seconds")]
    Sag(Duration),
    #[serde(rename = "glare_s", with = "seconds")]
    Glare(Duration),
    RoomLight(RoomLight),
    #[serde(rename = "door_s", with = "seconds")]
    Door(Duration),
    Id(u8),
    Mechanics(MechanicsKeys),
    #[serde(rename = "turn_deg", deserialize_with = "turn")]
    Turn(f64),
}

impl From<Spelling> for Disturbance {
    fn from(spelling: Spelling) -> Self {
        match spelling {
            Spelling::Silence(time) => Self::Silence(time),
            Spelling::HardwareError(bits) => Self::HardwareError(bits),
            Spelling::Overload => Self::OVERLOAD,
            Spelling::Overheating => Self::OVERHEATING,
            Spelling::Alert => Self::ALERT,
            Spelling::Stall(time) => Self::Stall(time),
            Spelling::RefusedTrigger => Self::RefusedTrigger,
            Spelling::LostAcknowledgement => Self::LostAcknowledgement,
            Spelling::Reboot => Self::Reboot,
            Spelling::WatchdogTrip => Self::WatchdogTrip,
            Spelling::Sag(time) => Self::Sag(time),
            Spelling::Glare(time) => Self::Glare(time),
            Spelling::RoomLight(light) => Self::RoomLight(light),
            Spelling::Door(time) => Self::Door(time),
            Spelling::Id(id) => Self::Id(id),
            Spelling::Mechanics(keys) => Self::Mechanics(keys),
            Spelling::Turn(deg) => Self::Turn(deg),
        }
    }
}

/// Disturbances to come, earliest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Schedule(VecDeque<(Duration, Disturbance)>);

impl Schedule {
    pub(crate) fn push(&mut self, at: Duration, what: Disturbance) {
        let place = self.0.partition_point(|&(earlier, _)| earlier <= at);
        self.0.insert(place, (at, what));
    }

    pub(crate) fn next(&self) -> Option<Duration> {
        self.0.front().map(|&(at, _)| at)
    }

    /// The first one, where it is due at `now`.
    pub(crate) fn pop(&mut self, now: Duration) -> Option<Disturbance> {
        self.0.pop_front_if(|(at, _)| *at <= now).map(|(_, what)| what)
    }
}

/// Durations as seconds.
mod seconds {
    use std::time::Duration;

    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub(super) fn serialize<S: Serializer>(duration: &Duration, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_f64(duration.as_secs_f64())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Duration, D::Error> {
        let seconds = f64::deserialize(from)?;
        Duration::try_from_secs_f64(seconds)
            .map_err(|_| D::Error::custom(format!("{seconds} s, allowed: 0 s and more")))
    }
}
