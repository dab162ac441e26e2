use arms::{ArmAngle, Pose};
use serde::{Deserialize, Serialize};

use crate::Gain;

mod certificate;
mod dark;
mod dark_set;
mod ladder;
mod lamp;
mod line;
mod linearity;
mod measure;
mod plausible;
mod rate;
mod reduction;
mod taken;
#[cfg(test)]
mod tests;

pub use certificate::{Certificate, Colour, Conditions, Patch, Trap, White, Zero, ZeroUncertainty};
pub use dark::{Dark, DarkCounts, Darks};
pub use dark_set::{DarkFault, check_dark_set};
pub use lamp::{Drift, Lamp};
pub use measure::Certified;
pub use reduction::{Budget, Reduction, Reflectance};
pub use taken::Taken;

/// Smallest cosine that a signal is divided by (89.94°): beyond, a hundredth of a degree changes f by a fifth.
pub const MIN_COSINE: f64 = 1e-3;

/// Smallest share of the nominal lamp output at which a reading says anything.
const MIN_LAMP: f64 = 0.01;

/// Which cosine the signal carries (Nicodemus; see docs/geometry.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filling {
    /// The light overfills what the sensor sees: signal ~ f · cos θ_i.
    Over,
    /// The light's spot lies within what the sensor sees: signal ~ f · cos θ_o.
    Under,
}

impl Filling {
    /// Angle of the arm whose cosine the signal carries.
    pub fn arm(self, pose: Pose) -> ArmAngle {
        match self {
            Self::Over => pose.light,
            Self::Under => pose.sensor,
        }
    }
}

/// Constants between counts and sr⁻¹; `[calibration]` of the rig file. What a certificate measured goes before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Which cosine the signal carries.
    pub filling: Filling,
    /// Counts per µs at gain ×1 for f·cos = 1 sr⁻¹ at nominal lamp output; red, green, blue.
    pub responsivity: [f64; 3],
    /// Monitor counts per µs at nominal lamp output.
    pub monitor: f64,
}

/// Why counts do not tell a reflectance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Unusable {
    /// A channel is at full scale: the reflectance is only known to be larger.
    #[error("a channel is at full scale")]
    Saturated,
    /// The light (overfilled) or the sensor (underfilled) stands too close to 90°.
    #[error("within 0.06° of grazing, where the signal's cosine vanishes")]
    Grazing,
    /// The monitor, or the visits to the reference pose, saw less than 1 % of the nominal lamp output.
    #[error("no light from the lamp was seen")]
    Lamp,
    /// The monitor is at full scale: the lamp's output is only known to be larger.
    #[error("the lamp monitor is at full scale: integration_max_us is too long for it")]
    Monitor,
    /// No dark reading at this gain says what was there without the lamp: none was taken, or light from outside filled it.
    #[error("no dark reading at gain ×{} that says anything", u16::from(*.0))]
    Dark(Gain),
}
