use arms::Arm;
use serde::{Deserialize, Serialize};

/// One of the devices on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Device {
    /// The servo of the light arm.
    Light,
    /// The servo of the sensor arm.
    Sensor,
    /// The photometer, which also switches the lamp.
    Photometer,
}

impl From<Arm> for Device {
    fn from(arm: Arm) -> Self {
        match arm {
            Arm::Light => Self::Light,
            Arm::Sensor => Self::Sensor,
        }
    }
}

impl std::fmt::Display for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Light => "light servo",
            Self::Sensor => "sensor servo",
            Self::Photometer => "photometer",
        })
    }
}

/// What generic code does about a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum FaultKind {
    /// No reply, or one that was damaged: worth another try until the device has been silent too long.
    NoReply,
    /// The device answered and refused the request: trying again will not help.
    Refused,
    /// The device reports a hardware error (overload, overheating, voltage): torque is off until it is rebooted.
    Hardware,
    /// An arm did not do what it was told: stalled, lost its torque, or never settled.
    Motion,
    /// Light from outside: what the photometer counts is not that of the lamp.
    Light,
    /// The port is gone.
    Disconnected,
    /// The device is not what the rig file says: wrong model, mode, limits.
    Mismatch,
    /// The rig file, or the port that it names, cannot be used; nothing was sent.
    Setup,
    /// This computer slept, or the program was stopped, for longer than the watchdogs wait.
    StoodStill,
}

/// An error of a rig, with the little that generic code needs of it.
pub trait Fault: std::error::Error + Send + Sync + 'static {
    /// What to do about it.
    fn kind(&self) -> FaultKind;

    /// The device at fault, where one can be named.
    fn device(&self) -> Option<Device>;
}

/// The bits of a Hardware Error Status in words (e-manual, "Hardware Error Status(70)"; docs/photometer.md).
pub(crate) fn hardware_error_names(device: Device, bits: u8) -> String {
    let bit_5 = match device {
        Device::Photometer => "lamp failure",
        Device::Light | Device::Sensor => "overload",
    };
    let names = [
        (0, "input voltage"),
        (2, "overheating"),
        (3, "encoder error"),
        (4, "electrical shock"),
        (5, bit_5),
    ];
    let named: Vec<_> = names
        .iter()
        .filter(|(bit, _)| bits & (1 << bit) != 0)
        .map(|&(_, name)| name)
        .collect();
    if named.is_empty() {
        format!("hardware error {bits:#04x}")
    } else {
        named.join(" and ")
    }
}
