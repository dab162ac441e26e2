use arms::ArmAngle;
use serde::{Deserialize, Serialize};

/// Counts of an X-series encoder per turn (e-manual, "Resolution").
const COUNTS_PER_TURN: f64 = 4096.0;

/// How an arm hangs on its servo: sign, offset and gear between servo counts and arm angle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// +1 where more counts mean a larger arm angle, −1 otherwise.
    pub sign: f64,
    /// Servo count at which the arm is at the normal.
    pub zero_count: f64,
    /// Servo turns per arm turn, > 0.
    pub gear: f64,
}

impl Axis {
    /// Counts per radian of arm angle, signed.
    fn scale(&self) -> f64 {
        self.sign * self.gear * COUNTS_PER_TURN / std::f64::consts::TAU
    }

    /// Arm angle at a position in counts, whole or not.
    pub fn angle(&self, counts: f64) -> ArmAngle {
        ArmAngle::from_rad((counts - self.zero_count) / self.scale())
    }

    /// Position in counts of an arm angle, not rounded.
    pub fn counts(&self, angle: ArmAngle) -> f64 {
        self.zero_count + angle.rad() * self.scale()
    }

    /// The arm angle nearest to `angle` that the servo can be told to take: a whole count.
    pub fn nearest(&self, angle: ArmAngle) -> ArmAngle {
        self.angle(self.counts(angle).round())
    }

    /// Arm angle of one count, rad, > 0.
    pub fn resolution_rad(&self) -> f64 {
        1.0 / self.scale().abs()
    }
}
