use serde::{Deserialize, Serialize};

use crate::{Arm, ArmAngle, Pose};

/// Angles that an arm may take, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Smallest angle.
    pub min: ArmAngle,
    /// Largest angle, ≥ min.
    pub max: ArmAngle,
}

impl Limits {
    /// Whether the angle lies within, ends included.
    pub fn contain(&self, angle: ArmAngle) -> bool {
        self.min <= angle && angle <= self.max
    }
}

/// What a pose or a motion would break.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Violation {
    /// An arm would leave its limits.
    #[error("{arm} arm at {:.3}° is outside its limits {:.3}° … {:.3}°", .angle.deg(), .limits.min.deg(), .limits.max.deg())]
    Limit {
        /// Which arm.
        arm: Arm,
        /// Where it would be.
        angle: ArmAngle,
        /// Where it may be.
        limits: Limits,
    },
    /// The arms would come closer than the separation.
    #[error("arms {:.3}° apart with light at {:.3}° and sensor at {:.3}°, at least {:.3}° are needed", .pose.separation_rad().to_degrees(), .pose.light.deg(), .pose.sensor.deg(), .separation_rad.to_degrees())]
    Separation {
        /// The offending pose, or the worst one of a motion.
        pose: Pose,
        /// The least separation, rad.
        separation_rad: f64,
    },
    /// The motion would take one arm past the other.
    #[error("arms would pass each other between light {:.3}°, sensor {:.3}° and light {:.3}°, sensor {:.3}°", .from.light.deg(), .from.sensor.deg(), .to.light.deg(), .to.sensor.deg())]
    Pass {
        /// Start of the motion.
        from: Pose,
        /// End of the motion.
        to: Pose,
    },
}

/// Where the arms may be and go.
///
/// A motion is checked over every pose of the rectangle between its ends: it stays safe however the two arms share
/// the time, also when one of them lags or stands still.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Envelope {
    /// Limits of the light arm.
    pub light: Limits,
    /// Limits of the sensor arm.
    pub sensor: Limits,
    /// Least angle between the arms at which the sensor sees the lit spot unshadowed, rad, ≥ 0.
    pub separation_rad: f64,
    /// Whether the arms clear each other mechanically, so that only the light is shadowed; otherwise they collide.
    pub can_pass: bool,
}

impl Envelope {
    /// Limits of one arm.
    pub fn limits(&self, arm: Arm) -> Limits {
        match arm {
            Arm::Light => self.light,
            Arm::Sensor => self.sensor,
        }
    }

    /// Whether one arm shadows the other at this pose.
    pub fn occluded(&self, pose: Pose) -> bool {
        pose.separation_rad() < self.separation_rad
    }

    /// How much further apart than the separation the arms stay, rad, while each of them moves by so much (rad, sign
    /// ignored), half of it before and half after they are at `pose`; negative where one may shadow the other, or pass it.
    ///
    /// As a motion is, this is judged over every pose of the rectangle that the two arms sweep, however they share the
    /// time. NaN where an angle is no number.
    pub fn clearance_rad(&self, pose: Pose, swept_rad: [f64; 2]) -> f64 {
        let [light, sensor] = swept_rad.map(f64::abs);
        pose.separation_rad() - (light + sensor) / 2.0 - self.separation_rad
    }

    /// Checks that a pose may be taken.
    ///
    /// # Errors
    /// The limit or the separation that it would break.
    pub fn check_pose(&self, pose: Pose) -> Result<(), Violation> {
        for arm in Arm::BOTH {
            let (angle, limits) = (pose.angle(arm), self.limits(arm));
            // NaN is outside every limit.
            if !limits.contain(angle) {
                return Err(Violation::Limit { arm, angle, limits });
            }
        }
        if !self.can_pass && self.occluded(pose) {
            return Err(Violation::Separation {
                pose,
                separation_rad: self.separation_rad,
            });
        }
        Ok(())
    }

    /// Checks that both arms may move together from one pose to another.
    ///
    /// # Errors
    /// What an end, or any pose on the way, would break.
    pub fn check_path(&self, from: Pose, to: Pose) -> Result<(), Violation> {
        self.check_pose(from)?;
        self.check_pose(to)?;
        if self.can_pass {
            return Ok(());
        }
        let corners = [
            from,
            to,
            from.with(Arm::Light, to.light),
            from.with(Arm::Sensor, to.sensor),
        ];
        if corners
            .iter()
            .any(|c| (c.light - c.sensor).signum() != (from.light - from.sensor).signum())
        {
            return Err(Violation::Pass { from, to });
        }
        match corners.into_iter().find(|&c| self.occluded(c)) {
            Some(pose) => Err(Violation::Separation {
                pose,
                separation_rad: self.separation_rad,
            }),
            None => Ok(()),
        }
    }
}
