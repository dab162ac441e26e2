use rig::{Device, FaultKind};

use crate::Refusal;

/// What goes wrong on the simulated rig.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum InProcessError {
    /// The device is silent, or its acknowledgement was lost.
    #[error("no reply from the {device} about {what}")]
    NoReply {
        /// Which device.
        device: Device,
        /// The register that was read or written.
        what: &'static str,
    },
    /// The device refused the request.
    #[error("{device} refused {what}: {refusal:?}")]
    Refused {
        /// Which device.
        device: Device,
        /// The register that was read or written.
        what: &'static str,
        /// Why.
        refusal: Refusal,
    },
    /// The device reports a hardware error.
    #[error("{device} reports hardware error {bits:#04x}")]
    Hardware {
        /// Which device.
        device: Device,
        /// Its Hardware Error Status.
        bits: u8,
    },
    /// The device is not what the rig file says.
    #[error("{device} is not as the rig file says: {}", .differences.join("; "))]
    Mismatch {
        /// Which device.
        device: Device,
        /// Each difference: what there is and what should be.
        differences: Vec<String>,
    },
}

impl rig::Fault for InProcessError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::NoReply { .. } => FaultKind::NoReply,
            Self::Refused { .. } => FaultKind::Refused,
            Self::Hardware { .. } => FaultKind::Hardware,
            Self::Mismatch { .. } => FaultKind::Mismatch,
        }
    }

    fn device(&self) -> Option<Device> {
        match self {
            Self::NoReply { device, .. }
            | Self::Refused { device, .. }
            | Self::Hardware { device, .. }
            | Self::Mismatch { device, .. } => Some(*device),
        }
    }
}
