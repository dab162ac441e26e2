use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::ArmAngle;

/// One of the two arms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Arm {
    /// The arm that carries the lamp.
    Light,
    /// The arm that carries the photometer.
    Sensor,
}

impl Arm {
    /// Both arms, in the order in which pairs of them are stored everywhere: light, sensor.
    pub const BOTH: [Self; 2] = [Self::Light, Self::Sensor];
}

impl std::fmt::Display for Arm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Light => "light",
            Self::Sensor => "sensor",
        })
    }
}

/// Where both arms are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// The light arm.
    pub light: ArmAngle,
    /// The sensor arm.
    pub sensor: ArmAngle,
}

impl Pose {
    /// A pose from two angles in degrees.
    pub fn from_deg(light_deg: f64, sensor_deg: f64) -> Self {
        Self {
            light: ArmAngle::from_deg(light_deg),
            sensor: ArmAngle::from_deg(sensor_deg),
        }
    }

    /// The angle of one arm.
    pub fn angle(&self, arm: Arm) -> ArmAngle {
        match arm {
            Arm::Light => self.light,
            Arm::Sensor => self.sensor,
        }
    }

    /// The same pose with one arm elsewhere.
    #[must_use]
    pub fn with(mut self, arm: Arm, angle: ArmAngle) -> Self {
        match arm {
            Arm::Light => self.light = angle,
            Arm::Sensor => self.sensor = angle,
        }
        self
    }

    /// Incident direction ω_i, from the specimen to the light.
    pub fn incident(&self) -> DVec3 {
        self.light.direction()
    }

    /// Exitant direction ω_o, from the specimen to the sensor.
    pub fn exitant(&self) -> DVec3 {
        self.sensor.direction()
    }

    /// Angle between the arms in radians, ≥ 0.
    pub fn separation_rad(&self) -> f64 {
        (self.light - self.sensor).abs()
    }

    /// Signed deviation from the mirror direction, sin α_light + sin α_sensor: |·| is d_p and the sign tells the side.
    pub fn deviation(&self) -> f64 {
        self.light.rad().sin() + self.sensor.rad().sin()
    }
}
