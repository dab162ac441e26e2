use arms::{Arm, ArmAngle, Envelope, Pose, Profile};
use serde::{Deserialize, Serialize};

/// What a plan needs to know of the rig: where the arms may go and how fast, and how long a reading takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mechanics {
    /// Limits and separation.
    pub envelope: Envelope,
    /// How much further apart than the separation the arms must be for a reading, rad: so unsure are their angles.
    pub margin_rad: f64,
    /// How far an arm may be from where it was told to be for a reading, rad.
    pub tolerance_rad: f64,
    /// Profiles of light and sensor arm.
    pub profiles: [Profile; 2],
    /// Smallest step of each arm, rad.
    pub resolution_rad: [f64; 2],
    /// One angle of each arm that its servo can take exactly, rad; the others are whole steps away.
    pub grid_rad: [f64; 2],
    /// +1 / −1: side from which the last approach comes (towards larger / smaller angles); 0: either.
    pub approach: i8,
    /// How far a motion from the wrong side goes beyond, rad.
    pub overshoot_rad: f64,
    /// Settling before each reading, s.
    pub settle_s: f64,
    /// How much later than its profile says an arm is expected to stand, s.
    #[serde(default)]
    pub late_s: f64,
    /// Shortest and longest integration, µs.
    pub integration_us: [u32; 2],
    /// Most exposures of one reading.
    pub exposures: u32,
    /// Expected time on the bus and on the host for each reading, s.
    pub transaction_s: f64,
    /// Whether the detector can be read while the arms move.
    #[serde(default = "can")]
    pub in_flight: bool,
    /// Expected seconds of one reading in flight: its light, and what the bus needs between two.
    pub flight_s: f64,
    /// Lamp warm-up, s.
    pub warm_up_s: f64,
    /// Seconds between two sets of dark readings; 0: at the start alone.
    pub dark_every_s: f64,
    /// Pose that is visited again and again to follow the lamp, and the seconds between two visits; `None`: the
    /// lamp's monitor follows it.
    pub reference: Option<(Pose, f64)>,
    /// Where the arms stand before the run; `None`: not known yet, then the plan's first leg is not timed or checked.
    pub start: Option<Pose>,
}

/// Every detector could be read in flight of which an older version wrote.
fn can() -> bool {
    true
}

impl Mechanics {
    /// Seconds from the end of a motion's profile to a reading.
    pub(crate) fn rest_s(&self) -> f64 {
        self.late_s + self.settle_s
    }

    /// Whole steps of an arm from its grid angle, not rounded.
    pub(crate) fn steps(&self, arm: Arm, angle: ArmAngle) -> f64 {
        (angle.rad() - self.grid_rad[arm as usize]) / self.resolution_rad[arm as usize]
    }

    /// The angle so many steps from the grid angle.
    pub(crate) fn angle(&self, arm: Arm, steps: f64) -> ArmAngle {
        ArmAngle::from_rad(self.grid_rad[arm as usize] + steps * self.resolution_rad[arm as usize])
    }

    /// The angle nearest to `angle` that the arm's servo can take.
    pub(crate) fn nearest(&self, arm: Arm, angle: ArmAngle) -> ArmAngle {
        self.angle(arm, self.steps(arm, angle).round())
    }

    /// The pose nearest to `pose` that both servos can take.
    pub(crate) fn nearest_pose(&self, pose: Pose) -> Pose {
        Arm::BOTH.into_iter().fold(pose, |pose, arm| {
            pose.with(arm, self.nearest(arm, pose.angle(arm)))
        })
    }

    /// Every angle within `from` … `to` that the arm's servo can take, ascending.
    pub(crate) fn angles(&self, arm: Arm, from: ArmAngle, to: ArmAngle) -> impl Iterator<Item = ArmAngle> {
        let (first, last) = (
            self.steps(arm, from).ceil() as i64,
            self.steps(arm, to).floor() as i64,
        );
        // Rounding of the product may put the outermost one just beyond.
        (first..=last)
            .map(move |k| self.angle(arm, k as f64))
            .filter(move |&angle| from <= angle && angle <= to)
    }

    /// Seconds from rest to rest: both arms set off together and the slower one counts.
    pub(crate) fn leg_s(&self, from: Pose, to: Pose) -> f64 {
        Arm::BOTH.into_iter().fold(0.0, |longest, arm| {
            let distance = to.angle(arm) - from.angle(arm);
            f64::max(longest, self.profiles[arm as usize].duration_s(distance))
        })
    }

    /// Seconds that an exposure is expected to take, while nothing is known of the specimen: gains lie a factor 16
    /// apart and the weakest that reaches the aim is used, so times spread evenly in the logarithm over the longest
    /// factor 16 of the range; this is their mean.
    pub(crate) fn integration_s(&self) -> f64 {
        let [shortest, longest] = self.integration_us.map(|us| f64::from(us) * 1e-6);
        let shortest = shortest.max(longest / 16.0);
        if longest <= shortest {
            return longest;
        }
        (longest - shortest) / (longest / shortest).ln()
    }
}
