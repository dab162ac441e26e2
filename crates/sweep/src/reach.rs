use arms::{Arm, Pose, Violation};

use crate::Mechanics;
use crate::route::overshoot;

/// Why no reading can be taken at a pose.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Hindrance {
    /// An arm would be outside its limits, also where it has to overshoot.
    Limits(Arm),
    /// One arm shadows the other.
    Shadow,
    /// The light would have to get past the sensor.
    Pass,
}

/// Which poses can be measured on a rig.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach<'a> {
    pub(crate) mechanics: &'a Mechanics,
    /// Sign of light − sensor that the arms keep for the whole run; 0: they can pass each other.
    side: f64,
}

impl<'a> Reach<'a> {
    /// What can be reached from `start`; without one, the light is taken to be below the sensor, where the mirror
    /// direction is.
    pub(crate) fn new(mechanics: &'a Mechanics, start: Option<Pose>) -> Self {
        let side = match start {
            _ if mechanics.envelope.can_pass => 0.0,
            Some(pose) => (pose.light - pose.sensor).signum(),
            None => -1.0,
        };
        Self { mechanics, side }
    }

    /// Whether a reading can be taken at the pose.
    pub(crate) fn check(&self, pose: Pose) -> Result<(), Hindrance> {
        let envelope = &self.mechanics.envelope;
        let beyond = overshoot(self.mechanics, pose, [true, true]);
        for pose in [pose, beyond] {
            if let Err(Violation::Limit { arm, .. }) = envelope.check_pose(pose) {
                return Err(Hindrance::Limits(arm));
            }
        }
        // Both arms may have stopped short of the pose, or in flight be read a little before or after it.
        let stops = [2.0 * self.mechanics.tolerance_rad; 2];
        if envelope.clearance_rad(pose, stops) < self.mechanics.margin_rad {
            return Err(Hindrance::Shadow);
        }
        if self.side != 0.0 && (pose.light - pose.sensor).signum() != self.side {
            return Err(Hindrance::Pass);
        }
        Ok(())
    }

    /// A hindrance in words, with the figures of the rig file.
    pub(crate) fn why(&self, hindrance: &Hindrance) -> String {
        let envelope = &self.mechanics.envelope;
        match hindrance {
            Hindrance::Limits(arm) => {
                let limits = envelope.limits(*arm);
                let overshoot = match self.mechanics.approach {
                    0 => String::new(),
                    _ => format!(
                        ", of which {:.1}° to overshoot",
                        self.mechanics.overshoot_rad.to_degrees()
                    ),
                };
                format!(
                    "the {arm} arm may be at {:.1}° … {:.1}°{overshoot}",
                    limits.min.deg(),
                    limits.max.deg()
                )
            }
            Hindrance::Shadow => {
                format!(
                    "arms closer than {:.1}° shadow each other",
                    envelope.separation_rad.to_degrees()
                )
            }
            Hindrance::Pass => "the arms cannot pass each other".to_owned(),
        }
    }
}
