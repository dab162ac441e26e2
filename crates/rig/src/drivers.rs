//! The detectors that a rig may have: the photometer node on the servos' bus, or an instrument elsewhere.
//!
//! A kind of detector is a file of its own here, and a line in [`AnyDetector`]; nothing outside of this module names an
//! instrument.

pub(crate) mod scpi;

use crate::dynamixel::Photometer;
use crate::{Counts, Detector, DetectorStatus, Exposure, Identity, RigError};

pub use scpi::{Profile, Scpi};

/// The detector of a rig, of whatever kind.
#[derive(Debug)]
pub enum AnyDetector {
    /// The photometer node on the servos' bus.
    Node(Photometer),
    /// An instrument that speaks SCPI.
    Scpi(Box<Scpi>),
}

impl Detector for AnyDetector {
    type Error = RigError;

    async fn identify(&mut self) -> Result<Identity, RigError> {
        match self {
            Self::Node(node) => node.identify().await,
            Self::Scpi(scpi) => scpi.identify().await,
        }
    }

    async fn lamp(&mut self, on: bool) -> Result<(), RigError> {
        match self {
            Self::Node(node) => node.lamp(on).await,
            Self::Scpi(scpi) => scpi.lamp(on).await,
        }
    }

    async fn trigger(&mut self, exposure: Exposure) -> Result<(), RigError> {
        match self {
            Self::Node(node) => node.trigger(exposure).await,
            Self::Scpi(scpi) => scpi.trigger(exposure).await,
        }
    }

    async fn status(&mut self) -> Result<DetectorStatus, RigError> {
        match self {
            Self::Node(node) => node.status().await,
            Self::Scpi(scpi) => scpi.status().await,
        }
    }

    async fn counts(&mut self) -> Result<Option<Counts>, RigError> {
        match self {
            Self::Node(node) => node.counts().await,
            Self::Scpi(scpi) => scpi.counts().await,
        }
    }

    async fn ticks(&mut self) -> Result<u32, RigError> {
        match self {
            Self::Node(node) => node.ticks().await,
            Self::Scpi(scpi) => scpi.ticks().await,
        }
    }
}
