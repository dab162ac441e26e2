use serde::{Deserialize, Serialize};

/// Velocity and acceleration with which an arm moves; both > 0, in rad/s and rad/s².
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// Cruising speed, rad/s, > 0.
    pub velocity_rad_s: f64,
    /// Acceleration and deceleration, rad/s², > 0 (infinite: a rectangular profile).
    pub acceleration_rad_s2: f64,
}

impl Profile {
    /// Seconds from rest to rest over `distance_rad` (sign ignored): t₁ + t₂ of the trapezoid, or the triangle's
    /// 2·√(d/a) where the cruising speed is not reached (Dynamixel e-manual, Profile Velocity).
    pub fn duration_s(&self, distance_rad: f64) -> f64 {
        Trajectory::new(0.0, 0.0, distance_rad, *self).duration_s()
    }
}

/// A trapezoidal motion from a position and a speed to rest at a goal: an exact function of time.
///
/// The unit of length is the caller's (radians or servo counts), as long as the profile uses the same. Positions
/// are evaluated in closed form, so that they do not depend on how often they are asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trajectory {
    goal: f64,
    /// (start position, start velocity, acceleration, duration) of at most four phases.
    phases: [(f64, f64, f64, f64); 4],
}

impl Trajectory {
    /// Motion from `position` at `velocity` to rest at `goal`, within `profile`.
    ///
    /// A start above the cruising speed, away from the goal, or too close to stop short of it brakes first, as the
    /// servo does on a change of goal (e-manual, "velocity override").
    pub fn new(position: f64, velocity: f64, goal: f64, profile: Profile) -> Self {
        let a = profile.acceleration_rad_s2;
        let v_max = profile.velocity_rad_s;
        if !a.is_finite() {
            let t = (goal - position).abs() / v_max;
            let v = v_max.copysign(goal - position);
            let phases = [
                (position, v, 0.0, t),
                (goal, 0.0, 0.0, 0.0),
                (goal, 0.0, 0.0, 0.0),
                (goal, 0.0, 0.0, 0.0),
            ];
            return Self { goal, phases };
        }
        let stop_distance = velocity * velocity.abs() / (2.0 * a);
        let to_go = goal - position;
        let direction = if to_go - stop_distance >= 0.0 { 1.0 } else { -1.0 };
        // In the frame where the remaining way, after an immediate stop, is positive.
        let (v0, d) = (velocity * direction, to_go * direction);
        let brake = (v0 - v_max).max(0.0) / a;
        let v1 = v0.min(v_max);
        let d1 = d - (v0 + v1) / 2.0 * brake;
        // Peak of the triangle that starts at v1 and ends at rest after d1.
        let peak = (a * d1 + v1 * v1 / 2.0).max(0.0).sqrt().min(v_max).max(v1);
        let up = (peak - v1) / a;
        let down = peak / a;
        // Below the cruising speed there is none; what rounding leaves of the way would be divided by a tiny peak.
        let cruise = if peak < v_max {
            0.0
        } else {
            ((d1 - (v1 + peak) / 2.0 * up - peak / 2.0 * down) / peak).max(0.0)
        };
        let mut phases = [(0.0, 0.0, 0.0, 0.0); 4];
        let (mut p, mut v) = (position, v0 * direction);
        for (phase, (acceleration, t)) in
            phases
                .iter_mut()
                .zip([(-a, brake), (a, up), (0.0, cruise), (-a, down)])
        {
            let acceleration = acceleration * direction;
            *phase = (p, v, acceleration, t);
            p += v * t + acceleration * t * t / 2.0;
            v += acceleration * t;
        }
        Self { goal, phases }
    }

    /// Where the motion ends.
    pub fn goal(&self) -> f64 {
        self.goal
    }

    /// Seconds until rest.
    pub fn duration_s(&self) -> f64 {
        self.phases.iter().map(|phase| phase.3).sum()
    }

    /// Position and velocity `t_s` seconds after the start; the goal and 0 from the end on.
    pub fn at(&self, t_s: f64) -> (f64, f64) {
        // Asked first, since the subtractions below round.
        if t_s >= self.duration_s() {
            return (self.goal, 0.0);
        }
        let mut t = t_s.max(0.0);
        for &(p, v, a, duration) in &self.phases {
            if t < duration {
                return (p + v * t + a * t * t / 2.0, v + a * t);
            }
            t -= duration;
        }
        (self.goal, 0.0)
    }
}
