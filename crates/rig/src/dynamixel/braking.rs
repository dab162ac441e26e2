use std::time::Duration;

use super::block::{Block, i32_at};
use super::register::servo;
use crate::Axis;

/// The registers that say where a servo comes to rest, from Profile Acceleration to Position Trajectory: in one reply, so
/// that they are of one moment.
pub(super) const REGISTERS: Block = Block::span(servo::PROFILE_ACCELERATION, servo::POSITION_TRAJECTORY);

/// An arm that stands is this near to where its servo's profile has led it, degrees of the arm: friction and load hold it off.
const HELD_DEG: f64 = 2.0;

/// What a servo's registers say of its motion, in their own units (e-manual, "Profile" and "Present Position").
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Braking {
    /// Profile Acceleration.
    pub acceleration: i32,
    /// Goal Position.
    pub goal: i32,
    /// Present Velocity.
    pub velocity: i32,
    /// Present Position.
    pub position: i32,
    /// Velocity Trajectory: the speed that the profile has now.
    pub velocity_trajectory: i32,
    /// Position Trajectory: where the profile is now.
    pub position_trajectory: i32,
}

impl Braking {
    pub(super) fn read(bytes: &[u8]) -> Self {
        let from = |register: super::register::Register| {
            i32_at(
                bytes,
                usize::from(register.address - servo::PROFILE_ACCELERATION.address),
            )
        };
        Self {
            acceleration: from(servo::PROFILE_ACCELERATION),
            goal: from(servo::GOAL_POSITION),
            velocity: from(servo::PRESENT_VELOCITY),
            position: from(servo::PRESENT_POSITION),
            velocity_trajectory: from(servo::VELOCITY_TRAJECTORY),
            position_trajectory: from(servo::POSITION_TRAJECTORY),
        }
    }

    /// The goal at which the servo comes to rest soonest on its profile, counts: between where it is and where it was going;
    /// `None` where its profile has ended and it stands there, though friction and load hold it off a little and it trembles.
    /// `ends` are the counts of the arm's limits, `latency` the time that a request takes.
    pub fn rest(&self, axis: &Axis, ends: [f64; 2], latency: Duration) -> Option<i32> {
        let units = axis.units;
        let position = f64::from(self.position);
        let held = HELD_DEG.to_radians() / axis.resolution_rad();
        let off = (f64::from(self.position_trajectory) - position).abs();
        if self.velocity_trajectory == 0 && self.position_trajectory == self.goal && off <= held {
            return None;
        }
        let velocity = units.counts(f64::from(self.velocity) * units.velocity_rad_s);
        let braking = match self.acceleration {
            0 => 0.0,
            of => velocity * velocity / (2.0 * units.counts(f64::from(of) * units.acceleration_rad_s2)),
        };
        // The arm has gone on since its position was read; a goal too near would make it swing back.
        let ahead = braking + velocity.abs() * latency.as_secs_f64();
        let rest = position + ahead.round().copysign(velocity);
        // Nor may it lead beyond where the arm was going: the way was checked only up to there.
        let heading = f64::from(self.goal);
        let rest = match (heading - position) * velocity > 0.0 {
            true if velocity > 0.0 => rest.min(heading),
            true => rest.max(heading),
            false => rest,
        };
        // Braking must not lead out of the limits, nor back.
        let (low, high) = (ends[0].min(ends[1]).round(), ends[0].max(ends[1]).round());
        Some(rest.clamp(low.min(position), high.max(position)).round() as i32)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::RigFile;

    const ENDS: [f64; 2] = [1000.0, 3000.0];
    const AT_REST: Braking = Braking {
        acceleration: 9,
        goal: 2000,
        velocity: 0,
        position: 1997,
        velocity_trajectory: 0,
        position_trajectory: 2000,
    };

    fn rest(of: Braking) -> Option<i32> {
        let file = RigFile::default();
        of.rest(&file.arms[0].axis, ENDS, Duration::from_millis(16))
    }

    #[test]
    fn an_arm_that_stands_is_left_alone_however_it_trembles() {
        for velocity in -12..=12 {
            for position in 1990..=2010 {
                let trembles = Braking {
                    velocity,
                    position,
                    ..AT_REST
                };
                assert_eq!(rest(trembles), None, "{trembles:?}");
            }
        }
    }

    #[test]
    fn an_arm_that_something_blocks_is_held_where_it_stands() {
        let blocked = Braking {
            goal: 2900,
            position: 1500,
            velocity_trajectory: 44,
            position_trajectory: 1900,
            ..AT_REST
        };
        assert_eq!(rest(blocked), Some(1500));
        let given_up = Braking {
            velocity_trajectory: 0,
            position_trajectory: 2900,
            ..blocked
        };
        assert_eq!(rest(given_up), Some(1500));
    }

    proptest! {
        #[test]
        fn prop_nothing_leads_beyond_the_limits_or_the_goal(
            acceleration in 0..1000_i32,
            (from, way) in (1000..3000_i32, 0.0..1.0_f64),
            goal in 1000..3000_i32,
            speed in 0..200_i32,
            lag in 0..40_i32,
        ) {
            let trajectory = from + (f64::from(goal - from) * way) as i32;
            let sign = (goal - from).signum();
            let moves = Braking {
                acceleration,
                goal,
                velocity: sign * speed,
                position: trajectory - sign * lag.min((trajectory - from).abs()),
                velocity_trajectory: sign * speed,
                position_trajectory: trajectory,
            };
            let (low, high) = (moves.position.min(goal), moves.position.max(goal));
            if let Some(rest) = rest(moves) {
                prop_assert!((low..=high).contains(&rest), "{moves:?}: {rest}");
            }
        }
    }
}
