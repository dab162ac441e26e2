use std::f64::consts::TAU;

use arms::{ArmAngle, Profile};
use serde::{Deserialize, Serialize};

/// Counts of an X-series encoder per turn (e-manual, "Resolution").
pub const COUNTS_PER_TURN: f64 = 4096.0;

/// Unit of the velocity registers, rad/s of the servo: 0.229 rev/min (e-manual, "Profile Velocity(112)").
pub const VELOCITY_UNIT_RAD_S: f64 = 0.229 * TAU / 60.0;

/// Unit of the acceleration registers, rad/s² of the servo: 214.577 rev/min² (e-manual, "Profile Acceleration(108)").
pub const ACCELERATION_UNIT_RAD_S2: f64 = 214.577 * TAU / 3600.0;

/// Largest value of a velocity register (e-manual, "Velocity Limit(44)": 0 … 1,023).
pub(crate) const VELOCITY_REGISTER_MAX: u32 = 1023;

/// Largest value of an acceleration register (e-manual, "Profile Acceleration(108)").
pub(crate) const ACCELERATION_REGISTER_MAX: u32 = 32_767;

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
        self.sign * self.gear * COUNTS_PER_TURN / TAU
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
            profile.velocity_rad_s * self.gear / VELOCITY_UNIT_RAD_S,
            VELOCITY_REGISTER_MAX,
        );
        let acceleration = if profile.acceleration_rad_s2.is_finite() {
            down(
                profile.acceleration_rad_s2 * self.gear / ACCELERATION_UNIT_RAD_S2,
                ACCELERATION_REGISTER_MAX,
            )
        } else {
            0
        };
        [velocity, acceleration]
    }

    /// The arm's profile for given register values; velocity > 0, acceleration 0 means infinite.
    pub fn profile(&self, [velocity, acceleration]: [u32; 2]) -> Profile {
        Profile {
            velocity_rad_s: f64::from(velocity) * VELOCITY_UNIT_RAD_S / self.gear,
            acceleration_rad_s2: match acceleration {
                0 => f64::INFINITY,
                units => f64::from(units) * ACCELERATION_UNIT_RAD_S2 / self.gear,
            },
        }
    }

    /// The profile that the servo will follow where it is asked for this one.
    pub fn quantised(&self, profile: Profile) -> Profile {
        self.profile(self.profile_registers(profile))
    }
}
