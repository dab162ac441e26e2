use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Angle of an arm from the specimen's normal, positive towards +x; radians inside, serialised as radians.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ArmAngle(f64);

impl ArmAngle {
    /// The arm upright over the specimen.
    pub const NORMAL: Self = Self(0.0);

    /// An angle in radians.
    pub const fn from_rad(rad: f64) -> Self {
        Self(rad)
    }

    /// An angle in degrees.
    pub fn from_deg(deg: f64) -> Self {
        Self(deg.to_radians())
    }

    /// The angle in radians.
    pub const fn rad(self) -> f64 {
        self.0
    }

    /// The angle in degrees.
    pub fn deg(self) -> f64 {
        self.0.to_degrees()
    }

    /// Unit vector from the specimen to the end of the arm, (sin α, 0, cos α).
    pub fn direction(self) -> DVec3 {
        let (sin, cos) = self.0.sin_cos();
        DVec3::new(sin, 0.0, cos)
    }
}

impl std::ops::Neg for ArmAngle {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

/// Difference of two angles, in radians.
impl std::ops::Sub for ArmAngle {
    type Output = f64;
    fn sub(self, other: Self) -> f64 {
        self.0 - other.0
    }
}
