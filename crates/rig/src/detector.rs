use std::future::Future;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{Fault, Identity};

/// Gain step of the photometer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(into = "u16", try_from = "u16")]
pub enum Gain {
    /// ×1
    X1,
    /// ×16
    X16,
    /// ×256
    X256,
}

impl Gain {
    /// All steps, weakest first; the index is the value of the gain register.
    pub const ALL: [Self; 3] = [Self::X1, Self::X16, Self::X256];

    /// The factor by which the signal is amplified.
    pub fn factor(self) -> f64 {
        f64::from(u16::from(self))
    }
}

impl From<Gain> for u16 {
    fn from(gain: Gain) -> Self {
        match gain {
            Gain::X1 => 1,
            Gain::X16 => 16,
            Gain::X256 => 256,
        }
    }
}

impl TryFrom<u16> for Gain {
    type Error = String;
    fn try_from(factor: u16) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|&gain| u16::from(gain) == factor)
            .ok_or_else(|| format!("gain {factor} is not one of 1, 16, 256"))
    }
}

/// How long and how strongly the photometer collects light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Exposure {
    /// Integration time in µs, within the range of the rig file.
    pub integration_us: u32,
    /// Gain step.
    pub gain: Gain,
}

impl Exposure {
    /// Integration time.
    pub fn duration(self) -> Duration {
        Duration::from_micros(u64::from(self.integration_us))
    }
}

/// What the photometer is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// Nothing was triggered yet.
    Idle,
    /// Collecting light.
    Integrating,
    /// A reading is there.
    Ready,
    /// A reading is there, and at least one channel is at full scale.
    Saturated,
}

/// The photometer's status in a snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DetectorStatus {
    /// What it is doing.
    pub phase: Phase,
    /// Sequence number: counts accepted triggers, 24 bits, wraps.
    pub sequence: u32,
}

/// One raw reading of the photometer, nothing corrected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Counts of the red, green and blue channel.
    pub rgb: [u32; 3],
    /// Counts of the lamp monitor, which integrates at gain ×1 over the same time.
    pub monitor: u32,
    /// The exposure with which they were taken, read back.
    pub exposure: Exposure,
    /// Whether a channel reached full scale.
    pub saturated: bool,
    /// Sequence number of the trigger that made it.
    pub sequence: u32,
    /// Device time at mid-integration, in ticks of 10 µs, 24 bits, wraps; the host unwraps it.
    pub ticks: u32,
    /// Photometer temperature, °C.
    pub temperature_c: u8,
}

/// The photometer and its lamp.
pub trait Detector: Send {
    /// What goes wrong.
    type Error: Fault;

    /// Reads who the device is and whether it is healthy; switches nothing.
    ///
    /// # Errors
    /// No reply, wrong model, hardware error.
    fn identify(&mut self) -> impl Future<Output = Result<Identity, Self::Error>> + Send;

    /// Switches the lamp. Switching it on arms the photometer's own watchdog, which puts the lamp out when the host
    /// goes silent; switching it off disarms that.
    ///
    /// # Errors
    /// No reply, hardware error.
    fn lamp(&mut self, on: bool) -> impl Future<Output = Result<(), Self::Error>> + Send;

    /// Starts one integration. An accepted trigger raises the sequence number by one; where the acknowledgement was
    /// lost, that tells whether it was accepted.
    ///
    /// # Errors
    /// No reply, refusal.
    fn trigger(&mut self, exposure: Exposure) -> impl Future<Output = Result<(), Self::Error>> + Send;

    /// Status and sequence number.
    ///
    /// # Errors
    /// No reply.
    fn status(&mut self) -> impl Future<Output = Result<DetectorStatus, Self::Error>> + Send;

    /// The latest reading; `None` before the first trigger and while one is being taken.
    ///
    /// # Errors
    /// No reply.
    fn counts(&mut self) -> impl Future<Output = Result<Option<Counts>, Self::Error>> + Send;

    /// The device's own clock now, in ticks of 10 µs, 24 bits, wraps.
    ///
    /// # Errors
    /// No reply.
    fn ticks(&mut self) -> impl Future<Output = Result<u32, Self::Error>> + Send;
}
