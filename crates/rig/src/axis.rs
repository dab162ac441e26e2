use std::f64::consts::TAU;

use arms::{ArmAngle, Profile};
use serde::{Deserialize, Serialize};

/// What the numbers of a servo's position, velocity and acceleration registers mean, and how large they may be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ServoUnits {
    /// Encoder counts per turn.
    pub counts_per_turn: f64,
    /// Unit of the velocity registers, rad/s of the servo.
    pub velocity_rad_s: f64,
    /// Unit of the acceleration registers, rad/s² of the servo.
    pub acceleration_rad_s2: f64,
    /// Largest value of a velocity register.
    pub velocity_max: u32,
    /// Largest value of an acceleration register.
    pub acceleration_max: u32,
}

impl ServoUnits {
    /// Those of the X series: 4096 counts a turn, 0.229 rev/min and 214.577 rev/min² (e-manual, XM430-W350, "Profile
    /// Velocity(112)", "Profile Acceleration(108)").
    pub const X: Self = Self::new(4096, 0.229, 214.577, 1023, 32_767);

    /// From the figures of a manual: counts a turn, units in rev/min and rev/min², largest register values.
    pub(crate) const fn new(
        counts_per_turn: u32,
        velocity_rpm: f64,
        acceleration_rpm2: f64,
        velocity_max: u32,
        acceleration_max: u32,
    ) -> Self {
        Self {
            counts_per_turn: counts_per_turn as f64,
            velocity_rad_s: velocity_rpm * TAU / 60.0,
            acceleration_rad_s2: acceleration_rpm2 * TAU / 3600.0,
            velocity_max,
            acceleration_max,
        }
    }

    /// Angle of the servo in counts.
    pub fn counts(&self, rad: f64) -> f64 {
        rad * self.counts_per_turn / TAU
    }

    /// Whether these are the units that an axis has where nothing else is said.
    fn are_those_of_x(&self) -> bool {
        *self == Self::X
    }
}

impl Default for ServoUnits {
    fn default() -> Self {
        Self::X
    }
}

/// How an arm hangs on its servo: sign, offset and gear between servo counts and arm angle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// +1 where more counts mean a larger arm angle, −1 otherwise.
    pub sign: f64,
    /// Servo count at which the arm is at the normal.
    pub zero_count: f64,
    /// Servo turns per arm turn, > 0.
    pub gear: f64,
    /// The servo's own units.
    #[serde(default, skip_serializing_if = "ServoUnits::are_those_of_x")]
    pub units: ServoUnits,
}

impl Axis {
    /// Counts per radian of arm angle, signed.
    fn scale(&self) -> f64 {
        self.sign * self.gear * self.units.counts_per_turn / TAU
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

    /// Values of the registers Profile Velocity and Profile Acceleration for an arm's profile: rounded down, at least
    /// 1, since 0 would mean no profile at all; 0 only for an infinite acceleration.
    pub fn profile_registers(&self, profile: Profile) -> [u32; 2] {
        // A profile that already is a multiple of the unit must not lose one to rounding.
        let down = |value: f64, max: u32| ((value + 1e-6).floor() as u32).clamp(1, max);
        let velocity = down(
            profile.velocity_rad_s * self.gear / self.units.velocity_rad_s,
            self.units.velocity_max,
        );
        let acceleration = if profile.acceleration_rad_s2.is_finite() {
            down(
                profile.acceleration_rad_s2 * self.gear / self.units.acceleration_rad_s2,
                self.units.acceleration_max,
            )
        } else {
            0
        };
        [velocity, acceleration]
    }

    /// The arm's profile for given register values; velocity > 0, acceleration 0 means infinite.
    pub fn profile(&self, [velocity, acceleration]: [u32; 2]) -> Profile {
        Profile {
            velocity_rad_s: f64::from(velocity) * self.units.velocity_rad_s / self.gear,
            acceleration_rad_s2: match acceleration {
                0 => f64::INFINITY,
                units => f64::from(units) * self.units.acceleration_rad_s2 / self.gear,
            },
        }
    }

    /// The profile that the servo will follow where it is asked for this one.
    pub fn quantised(&self, profile: Profile) -> Profile {
        self.profile(self.profile_registers(profile))
    }
}
