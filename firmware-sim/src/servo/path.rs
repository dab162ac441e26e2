use std::collections::VecDeque;

use arms::{Profile, Trajectory};

/// One stretch of a path: a trajectory from a moment on.
#[derive(Clone, Copy, Debug)]
struct Leg {
    start_s: f64,
    trajectory: Trajectory,
    /// Seconds after the start and position where the motion turns back, if it does.
    turn: Option<(f64, f64)>,
    /// Where the far side of the play was at the start.
    follower: f64,
}

/// Position over time in counts: trajectories that take over from each other at given moments.
///
/// Everything is a closed form of time, back to what [`forget`](Self::forget) let go; how often it is asked does not
/// matter. Times are seconds since power-on.
#[derive(Clone, Debug)]
pub(super) struct Path {
    legs: VecDeque<Leg>,
    /// Half of the play between this path and what follows it, counts.
    half_play: f64,
}

/// Resting speed and acceleration: what a motion of no length is computed with.
const ANY: Profile = Profile {
    velocity_rad_s: 1.0,
    acceleration_rad_s2: f64::INFINITY,
};

impl Path {
    /// At rest at a position, its follower in the middle of the play.
    pub(super) fn resting(position: f64, half_play: f64) -> Self {
        let leg = Leg {
            start_s: 0.0,
            trajectory: Trajectory::new(position, 0.0, position, ANY),
            turn: None,
            follower: position,
        };
        Self {
            legs: VecDeque::from([leg]),
            half_play,
        }
    }

    fn leg(&self, t_s: f64) -> &Leg {
        self.legs
            .iter()
            .rev()
            .find(|leg| leg.start_s <= t_s)
            .unwrap_or(&self.legs[0])
    }

    /// Position and velocity, counts and counts/s.
    pub(super) fn at(&self, t_s: f64) -> (f64, f64) {
        let leg = self.leg(t_s);
        leg.trajectory.at(t_s - leg.start_s)
    }

    /// Where what hangs on this path is: it trails by half the play, on the side from which the path came last.
    pub(super) fn follower(&self, t_s: f64) -> f64 {
        let leg = self.leg(t_s);
        let t = t_s - leg.start_s;
        let dragged = |follower: f64, by: f64| follower.clamp(by - self.half_play, by + self.half_play);
        let mut follower = leg.follower;
        if let Some((turn_s, position)) = leg.turn
            && t > turn_s
        {
            follower = dragged(follower, position);
        }
        dragged(follower, leg.trajectory.at(t).0)
    }

    /// Seconds since the last motion ended and how far it led, counts; `None` while it goes on.
    pub(super) fn since_motion(&self, t_s: f64) -> Option<(f64, f64)> {
        let leg = self.leg(t_s);
        let since_s = t_s - leg.start_s - leg.trajectory.duration_s();
        (since_s >= 0.0).then(|| (since_s, leg.trajectory.goal() - leg.trajectory.at(0.0).0))
    }

    /// When the last motion ends.
    pub(super) fn end_s(&self) -> f64 {
        let leg = &self.legs[self.legs.len() - 1];
        leg.start_s + leg.trajectory.duration_s()
    }

    /// From `start_s` on, moves from what position and velocity are then to rest at `goal`; what was to come after
    /// `start_s` is dropped.
    pub(super) fn go(&mut self, start_s: f64, goal: f64, profile: Profile) {
        let (position, velocity) = self.at(start_s);
        let turn = turn(position, velocity, goal, profile);
        self.take_over(start_s, Trajectory::new(position, velocity, goal, profile), turn);
    }

    /// From `start_s` on, rests at `position` without a motion to it.
    pub(super) fn jump(&mut self, start_s: f64, position: f64) {
        self.take_over(start_s, Trajectory::new(position, 0.0, position, ANY), None);
    }

    fn take_over(&mut self, start_s: f64, trajectory: Trajectory, turn: Option<(f64, f64)>) {
        let follower = self.follower(start_s);
        while self.legs.len() > 1 && self.legs[self.legs.len() - 1].start_s > start_s {
            self.legs.pop_back();
        }
        self.legs.push_back(Leg {
            start_s,
            trajectory,
            turn,
            follower,
        });
    }

    /// Moments after `from_s` and before `to_s` at which the motion changes its law.
    pub(super) fn breaks(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = f64> {
        self.legs
            .iter()
            .flat_map(|leg| [leg.start_s, leg.start_s + leg.trajectory.duration_s()])
            .filter(move |&t| from_s < t && t < to_s)
    }

    /// Whether anything moves within a stretch of time.
    pub(super) fn rests(&self, from_s: f64, to_s: f64) -> bool {
        let later = self
            .legs
            .iter()
            .any(|leg| from_s < leg.start_s && leg.start_s < to_s);
        let leg = self.leg(from_s);
        !later && leg.start_s + leg.trajectory.duration_s() <= from_s
    }

    /// Lets go of what came before a moment.
    pub(super) fn forget(&mut self, before_s: f64) {
        while self.legs.len() > 1 && self.legs[1].start_s <= before_s {
            self.legs.pop_front();
        }
    }
}

/// Where a motion that starts away from its goal, or too fast to stop short of it, turns back: seconds and position.
fn turn(position: f64, velocity: f64, goal: f64, profile: Profile) -> Option<(f64, f64)> {
    let a = profile.acceleration_rad_s2;
    let rest = position + velocity * velocity.abs() / (2.0 * a);
    ((goal - rest) * velocity < 0.0).then_some((velocity.abs() / a, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROFILE: Profile = Profile {
        velocity_rad_s: 100.0,
        acceleration_rad_s2: 200.0,
    };

    #[test]
    fn what_follows_trails_by_half_the_play() {
        let mut path = Path::resting(0.0, 2.0);
        path.go(0.0, 100.0, PROFILE);
        assert_eq!(path.follower(10.0), 98.0);
        path.go(10.0, 97.0, PROFILE);
        assert_eq!(path.follower(20.0), 98.0, "less than the play back");
        path.go(20.0, 50.0, PROFILE);
        assert_eq!(path.follower(30.0), 52.0);
    }

    #[test]
    fn a_turn_within_a_motion_takes_up_the_play_on_both_sides() {
        let mut path = Path::resting(0.0, 2.0);
        path.go(0.0, 1000.0, PROFILE);
        // Back in full flight: it turns at 75 + 25.
        path.go(1.0, 90.0, PROFILE);
        let (at_turn, speed) = path.at(1.5);
        assert!(
            (at_turn - 100.0).abs() < 1e-9 && speed.abs() < 1e-9,
            "turns at {at_turn}"
        );
        assert!((path.follower(1.5) - 98.0).abs() < 1e-9);
        assert_eq!(path.follower(20.0), 92.0);
        // And only as far as the turn took it.
        let mut path = Path::resting(0.0, 2.0);
        path.go(0.0, 1000.0, PROFILE);
        path.go(1.0, 98.0, PROFILE);
        assert!((path.follower(20.0) - 98.0).abs() < 1e-9);
    }

    #[test]
    fn forgetting_changes_nothing_later() {
        let mut path = Path::resting(0.0, 1.0);
        path.go(0.0, 100.0, PROFILE);
        path.go(0.7, 20.0, PROFILE);
        path.go(1.1, 60.0, PROFILE);
        let mut short = path.clone();
        short.forget(1.2);
        assert_eq!(short.legs.len(), 1);
        for i in 0..100 {
            let t = 1.2 + f64::from(i) * 0.03;
            assert_eq!((path.at(t), path.follower(t)), (short.at(t), short.follower(t)));
        }
    }

    #[test]
    fn a_motion_to_come_is_dropped_by_one_that_starts_before_it() {
        let mut path = Path::resting(0.0, 0.0);
        path.go(1.0, 100.0, PROFILE);
        path.jump(0.5, 7.0);
        assert_eq!(path.at(9.0), (7.0, 0.0));
    }
}
