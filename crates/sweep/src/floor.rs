use arms::{Arm, Pose, Profile};

use crate::Mechanics;

/// Seconds below which no capture can be that rests for each of these readings: the slower arm's trapezoid between each
/// two poses and the settling after it, the light of the readings, given with their poses in s, and the warm-up of the
/// lamp. Bus, host, detours and exposures that do not count take no time here.
///
/// `from` is where the arms stand before; `None`: at the first pose.
pub fn floor_s(
    mechanics: &Mechanics,
    from: Option<Pose>,
    readings: impl IntoIterator<Item = (Pose, f64)>,
) -> f64 {
    let mut at = from;
    let mut floor_s = mechanics.warm_up_s;
    for (pose, light_s) in readings {
        let motion_s = at.replace(pose).map_or(0.0, |at| leg_s(mechanics, at, pose));
        if motion_s > 0.0 {
            floor_s += motion_s + mechanics.settle_s;
        }
        floor_s += light_s;
    }
    floor_s
}

fn leg_s(mechanics: &Mechanics, from: Pose, to: Pose) -> f64 {
    let [light_s, sensor_s] = Arm::BOTH.map(|arm| {
        let way_rad = (to.angle(arm) - from.angle(arm)).abs();
        trapezoid_s(way_rad, mechanics.profiles[arm as usize])
    });
    light_s.max(sensor_s)
}

/// From rest to rest. Not [`Profile::duration_s`], by which planner and simulator go: what is wrong there is to show
/// beside this.
fn trapezoid_s(way_rad: f64, profile: Profile) -> f64 {
    let (v, a) = (profile.velocity_rad_s, profile.acceleration_rad_s2);
    // Of speeding up and braking.
    let ramps_rad = v * v / a;
    if way_rad < ramps_rad {
        2.0 * (way_rad / a).sqrt()
    } else {
        way_rad / v + v / a
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Velocity 20 and acceleration 5 in the servo's units, as worked out by hand from the e-manual's formulas.
    #[test]
    fn a_servo_needs_what_its_manual_says() {
        let profile = Profile {
            velocity_rad_s: (20.0 * 0.229 * 6.0_f64).to_radians(),
            acceleration_rad_s2: (5.0 * 214.577 / 10.0_f64).to_radians(),
        };
        for (way_deg, seconds) in [(1.0, 0.193), (5.0, 0.432), (90.0, 3.53), (160.0, 6.08)] {
            let found_s = trapezoid_s(f64::to_radians(way_deg), profile);
            assert!((found_s - seconds).abs() < 0.005, "{way_deg}°: {found_s} s");
        }
        let abrupt = Profile {
            acceleration_rad_s2: f64::INFINITY,
            ..profile
        };
        assert!((trapezoid_s(profile.velocity_rad_s, abrupt) - 1.0).abs() < 1e-12);
        assert_eq!(trapezoid_s(0.0, profile), 0.0);
    }
}
