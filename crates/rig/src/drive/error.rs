use std::time::Duration;

use arms::{Arm, ArmAngle, Violation};

use super::Hindrance;
use crate::fault::hardware_error_names;
use crate::{Device, Exposure, Fault, FaultKind};

/// What goes wrong while a rig is driven; `E` is the error of the rig itself.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DriveError<E: Fault> {
    /// A device failed, after what was worth trying again had been tried again.
    #[error("cannot {what}{}", if *.retries > 0 { format!(", tried {} times in {:.1} s", .retries + 1, .tried.as_secs_f64()) } else { String::new() })]
    Device {
        /// What was attempted.
        what: &'static str,
        /// How often it was repeated.
        retries: u32,
        /// For how long it was tried.
        tried: Duration,
        /// The last failure.
        source: E,
    },
    /// The motion would leave the envelope; nothing moved.
    #[error("motion refused")]
    Envelope(#[source] Violation),
    /// An arm never took its goal, or lost it.
    #[error(
        "{arm} arm did not take or keep the goal {:.3}° within {:.1} s, it has {:.3}° (bus watchdog tripped, or another program on the bus?)",
        .goal.deg(), .tried.as_secs_f64(), .has.deg()
    )]
    GoalNotTaken {
        /// Which arm.
        arm: Arm,
        /// What it was told.
        goal: ArmAngle,
        /// What its goal register says.
        has: ArmAngle,
        /// For how long it was told.
        tried: Duration,
    },
    /// An arm did not arrive, or did not stay.
    #[error(
        "{arm} arm stands at {:.3}° instead of {:.3}° ± {:.3}° after {:.2} s: {hindrance}",
        .measured.deg(), .goal.deg(), .near_rad.to_degrees(), .after.as_secs_f64()
    )]
    NotArrived {
        /// Which arm.
        arm: Arm,
        /// Where it should be.
        goal: ArmAngle,
        /// Where it is.
        measured: ArmAngle,
        /// How near it should be, rad.
        near_rad: f64,
        /// How long it had.
        after: Duration,
        /// What it looks like.
        hindrance: Hindrance,
    },
    /// A servo reports a hardware error; its torque may be off.
    #[error("{arm} servo reports {} at {:.3}°; remove the cause, then switch its power off and on", hardware_error_names(Device::from(*.arm), *.bits), .measured.deg())]
    Hardware {
        /// Which arm.
        arm: Arm,
        /// The bits of its Hardware Error Status.
        bits: u8,
        /// Where it is.
        measured: ArmAngle,
    },
    /// A servo has lost its torque without a hardware error: it was restarted, or another program switched it off.
    #[error("{arm} servo has lost its torque at {:.3}° (restarted, or switched off by another program?)", .measured.deg())]
    TorqueLost {
        /// Which arm.
        arm: Arm,
        /// Where it is.
        measured: ArmAngle,
    },
    /// The photometer did not deliver the reading that was triggered.
    #[error("photometer did not deliver reading {expected} ({} µs, {:?}): {found}", .exposure.integration_us, .exposure.gain)]
    Reading {
        /// Sequence number of the trigger.
        expected: u32,
        /// With what it was triggered.
        exposure: Exposure,
        /// What came instead.
        found: String,
    },
}

impl<E: Fault> DriveError<E> {
    /// What generic code does about it.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::Device { source, .. } => source.kind(),
            Self::Envelope(_) => FaultKind::Refused,
            Self::GoalNotTaken { .. } | Self::NotArrived { .. } | Self::TorqueLost { .. } => {
                FaultKind::Motion
            }
            Self::Hardware { .. } => FaultKind::Hardware,
            Self::Reading { .. } => FaultKind::NoReply,
        }
    }

    /// The device at fault, where one can be named.
    pub fn device(&self) -> Option<Device> {
        match self {
            Self::Device { source, .. } => source.device(),
            Self::Envelope(_) => None,
            Self::GoalNotTaken { arm, .. }
            | Self::NotArrived { arm, .. }
            | Self::TorqueLost { arm, .. }
            | Self::Hardware { arm, .. } => Some((*arm).into()),
            Self::Reading { .. } => Some(Device::Photometer),
        }
    }

    /// How often the failed request was repeated.
    pub fn retries(&self) -> u32 {
        match self {
            Self::Device { retries, .. } => *retries,
            _ => 0,
        }
    }
}
