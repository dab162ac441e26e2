use std::path::PathBuf;

use arms::ArmAngle;

use crate::fault::hardware_error_names;
use crate::{Device, Fault, FaultKind};

/// A place in a file, for error texts: "rig.toml, line 12".
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file, as it was named.
    pub file: PathBuf,
    /// Line, from 1, where one is to blame.
    pub line: Option<usize>,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.file.display())?;
        self.line.map_or(Ok(()), |line| write!(f, ", line {line}"))
    }
}

/// What goes wrong with a rig file, its port or its devices.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RigError {
    /// The rig file cannot be read.
    #[error("cannot read the rig file {}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The rig file is no TOML, or has an unknown key, or a value of the wrong type.
    #[error("{place}: {}{why}", .key.as_ref().map(|key| format!("{key}: ")).unwrap_or_default())]
    Form {
        /// Where.
        place: Place,
        /// The key, where one is to blame.
        key: Option<String>,
        /// What was found and expected.
        why: String,
    },
    /// A value of the rig file is not allowed.
    #[error("{place}: {key} is {found}, allowed: {allowed}")]
    Value {
        /// Where.
        place: Place,
        /// The key, with its table.
        key: String,
        /// What was found.
        found: String,
        /// What may stand there.
        allowed: String,
    },
    /// A value of a calibration certificate is one that no rig of this rig file can have.
    #[error("{key} is {found}, allowed: {allowed}")]
    Certificate {
        /// The key, with its table, such as `white.gains[1]`.
        key: String,
        /// What was found.
        found: String,
        /// What may stand there.
        allowed: String,
    },
    /// The readings of a standard do not make a calibration.
    #[error("{what}: {why}")]
    Calibration {
        /// Which standard.
        what: &'static str,
        /// What is missing.
        why: String,
    },
    /// The system does not list its serial ports.
    #[error("cannot list the serial ports")]
    Ports {
        /// Why.
        source: serialport::Error,
    },
    /// There is no such port.
    #[error("there is no serial port {}; present: {}", .port.display(), listed(.present))]
    PortMissing {
        /// As the rig file or the command says.
        port: PathBuf,
        /// What there is.
        present: Vec<PathBuf>,
    },
    /// Another program has it.
    #[error("serial port {} is in use by another program (goniod, a terminal, a Dynamixel wizard?)", .port.display())]
    PortLocked {
        /// Which.
        port: PathBuf,
        /// What the system said.
        source: serialport::Error,
    },
    /// The user may not open it.
    #[error("serial port {} may not be opened by this user; `ls -l` shows the group that may (often dialout)", .port.display())]
    PortDenied {
        /// Which.
        port: PathBuf,
        /// What the system said.
        source: serialport::Error,
    },
    /// It is no serial port, or cannot do the baud rate.
    #[error("{} cannot be used as serial port", .port.display())]
    PortUnusable {
        /// Which.
        port: PathBuf,
        /// What the system said.
        source: serialport::Error,
    },
    /// The thread of the bus cannot be started.
    #[error("cannot start the thread of the bus")]
    Thread {
        /// Why.
        source: std::io::Error,
    },
    /// The port has vanished under us.
    #[error("the serial port is gone (adapter unplugged?)")]
    PortGone {
        /// What the system said.
        source: std::io::Error,
    },
    /// A device says nothing.
    #[error("{device} (id {id}) gives no reply: check its power, cable, id and baud rate")]
    NoReply {
        /// Which.
        device: Device,
        /// Its id.
        id: u8,
    },
    /// A device's reply was damaged, or was none to what was asked.
    #[error("damaged reply of the {device} (id {id}): {why}")]
    BadReply {
        /// Which.
        device: Device,
        /// Its id.
        id: u8,
        /// What was wrong.
        why: String,
    },
    /// A device refused a request.
    #[error("{device} (id {id}) refused: {}", refusal(*.number))]
    Refused {
        /// Which.
        device: Device,
        /// Its id.
        id: u8,
        /// Error number of its status packet.
        number: u8,
    },
    /// A device reports a hardware error.
    #[error("{device} (id {id}) reports {}; remove the cause, then switch its power off and on", hardware_error_names(*.device, *.bits))]
    Hardware {
        /// Which.
        device: Device,
        /// Its id.
        id: u8,
        /// Bits of its Hardware Error Status.
        bits: u8,
    },
    /// A device is not what the rig file says.
    #[error("{device} (id {id}): {}", .differences.join("; "))]
    Mismatch {
        /// Which.
        device: Device,
        /// Its id.
        id: u8,
        /// Each difference, and how to mend it.
        differences: Vec<String>,
    },
    /// An instrument in the place of the photometer is silent, or answers what it should not.
    #[error("the detector at {address}: {what}")]
    Instrument {
        /// Where it is.
        address: String,
        /// Whether it answered, so that asking again will not help.
        answered: bool,
        /// What is wrong, and what to do about it.
        what: String,
    },
    /// An arm was to move that was not engaged.
    #[error("{device} is not engaged, it must not move")]
    NotEngaged {
        /// Which.
        device: Device,
    },
    /// An arm moved, or did not hold, as its torque came on; the torque was switched off again.
    #[error("{device} did not hold as its torque came on: {:.2}° before, {:.2}° after; its torque is off again", .before.deg(), .after.deg())]
    Moved {
        /// Which.
        device: Device,
        /// Where it was.
        before: ArmAngle,
        /// Where it is.
        after: ArmAngle,
    },
}

fn listed(ports: &[PathBuf]) -> String {
    if ports.is_empty() {
        return "none".to_owned();
    }
    let names: Vec<_> = ports.iter().map(|port| port.display().to_string()).collect();
    names.join(", ")
}

/// Error numbers of status packets in words (e-manual, Protocol 2.0, "Error").
fn refusal(number: u8) -> String {
    let name = match number {
        1 => "it failed to process the request",
        2 => "it does not know the instruction",
        4 => "value out of range, or its bus watchdog has tripped",
        5 => "wrong length for the address",
        6 => "value beyond its limits",
        7 => "read-only, or locked while torque or lamp is on",
        _ => return format!("error number {number}"),
    };
    name.to_owned()
}

impl Fault for RigError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Read { .. }
            | Self::Form { .. }
            | Self::Value { .. }
            | Self::Certificate { .. }
            | Self::Calibration { .. }
            | Self::Ports { .. }
            | Self::PortMissing { .. }
            | Self::PortLocked { .. }
            | Self::PortDenied { .. }
            | Self::PortUnusable { .. }
            | Self::Thread { .. } => FaultKind::Setup,
            Self::PortGone { .. } => FaultKind::Disconnected,
            Self::NoReply { .. } | Self::BadReply { .. } | Self::Instrument { answered: false, .. } => {
                FaultKind::NoReply
            }
            Self::Instrument { answered: true, .. } => FaultKind::Refused,
            Self::Refused { .. } | Self::NotEngaged { .. } => FaultKind::Refused,
            Self::Hardware { .. } => FaultKind::Hardware,
            Self::Mismatch { .. } => FaultKind::Mismatch,
            Self::Moved { .. } => FaultKind::Motion,
        }
    }

    fn device(&self) -> Option<Device> {
        match self {
            Self::NoReply { device, .. }
            | Self::BadReply { device, .. }
            | Self::Refused { device, .. }
            | Self::Hardware { device, .. }
            | Self::Mismatch { device, .. }
            | Self::NotEngaged { device }
            | Self::Moved { device, .. } => Some(*device),
            Self::Instrument { .. } => Some(Device::Photometer),
            _ => None,
        }
    }
}
