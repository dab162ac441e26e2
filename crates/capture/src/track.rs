use arms::{Profile, Trajectory};

/// What was measured so long before and after a moment tells where the arm was then, s: several counts of the encoder
/// even at its slowest.
const WINDOW_S: f64 = 0.08;
/// Most by which an arm is taken to follow late, s; while it hardly moves yet, whole counts say little.
const LATEST_S: f64 = 0.3;
/// Fewest measurements that are evened out by a line.
const FEWEST: usize = 4;

/// One arm in flight: the motion that it was told, and what was measured of it. Angles in rad; times in s of the
/// photometer's clock.
///
/// An encoder shows whole counts, which at a lobe is too coarse. The motion is known but for how late the arm follows;
/// what is measured is compared with it, and what remains is evened out over many measurements.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    /// When each motion began.
    legs: Vec<(f64, Trajectory)>,
    seen: Vec<(f64, f64)>,
    /// Sums over all measurements of how far the arm lagged times its speed, and of the speed squared.
    lags: (f64, f64),
}

impl Track {
    /// An arm at rest.
    pub(crate) fn resting(angle: f64, profile: Profile) -> Self {
        Self {
            legs: vec![(f64::NEG_INFINITY, Trajectory::new(angle, 0.0, angle, profile))],
            seen: Vec::new(),
            lags: (0.0, 0.0),
        }
    }

    /// The arm was told to go (on) to a goal on this profile.
    pub(crate) fn steer(&mut self, t_s: f64, goal: f64, profile: Profile) {
        let (angle, speed) = self.told(t_s);
        self.legs
            .push((t_s, Trajectory::new(angle, speed, goal, profile)));
    }

    /// The arm was measured.
    pub(crate) fn saw(&mut self, t_s: f64, angle: f64) {
        // What it was told by then never changes, so that it need not be asked again at every look.
        let (told, speed) = self.told(t_s);
        self.lags.0 += (told - angle) * speed;
        self.lags.1 += speed * speed;
        self.seen.push((t_s, angle));
    }

    /// Angle and speed that the arm was told to have.
    fn told(&self, t_s: f64) -> (f64, f64) {
        let leg = self.legs.iter().rev().find(|leg| leg.0 <= t_s);
        let &(start_s, trajectory) = leg.unwrap_or(&self.legs[0]);
        trajectory.at(t_s - start_s)
    }

    /// By how much the arm is late, s: what fits all measurements best, where it moved.
    pub(crate) fn late_s(&self) -> f64 {
        let (products, squares) = self.lags;
        if squares > 0.0 {
            (products / squares).clamp(0.0, LATEST_S)
        } else {
            0.0
        }
    }

    /// Speed that the arm has, rad/s.
    pub(crate) fn speed(&self, t_s: f64) -> f64 {
        self.told(t_s - self.late_s()).1
    }

    /// Where the arm is, as far as it does what it was told.
    pub(crate) fn expected(&self, t_s: f64) -> f64 {
        self.told(t_s - self.late_s()).0
    }

    /// When the arm will be at an angle on its way, or at rest where that is beyond its goal.
    pub(crate) fn when(&self, angle: f64) -> f64 {
        let begins = |leg: &(f64, Trajectory)| leg.1.at(0.0).0;
        // What the arm, being late, has still to pass may lie before the last turn of its profile.
        let leads = |leg: &&(f64, Trajectory)| {
            leg.0.is_finite() && (angle - begins(leg)) * (leg.1.goal() - begins(leg)) >= 0.0
        };
        let first = self.legs.iter().find(|leg| leg.0.is_finite());
        let Some(&leg) = self.legs.iter().rev().find(leads).or(first) else {
            return f64::INFINITY;
        };
        let (start_s, trajectory) = leg;
        let from = begins(&leg);
        let way = |t_s: f64| (trajectory.at(t_s).0 - from).abs();
        let wanted = (angle - from) * (trajectory.goal() - from).signum();
        let (mut before, mut after) = (0.0, trajectory.duration_s());
        // The way grows with time. 40 halvings of a minute are below a nanosecond.
        for _ in 0..40 {
            let middle = (before + after) / 2.0;
            if way(middle) < wanted {
                before = middle;
            } else {
                after = middle;
            }
        }
        start_s + after + self.late_s()
    }

    /// Where the arm was, by what was measured around then, and the standard deviation of the measurements from that, rad.
    pub(crate) fn at(&self, t_s: f64) -> (f64, f64) {
        let late_s = self.late_s();
        let mut near: Vec<(f64, f64)> = self
            .seen
            .iter()
            .map(|&(seen_s, angle)| (seen_s - t_s, angle - self.told(seen_s - late_s).0))
            .collect();
        near.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        let within = near.iter().filter(|(off_s, _)| off_s.abs() <= WINDOW_S).count();
        near.truncate(within.max(FEWEST));
        let (value, slope) = line(&near);
        let square = |&(x, y): &(f64, f64)| (y - value - slope * x).powi(2);
        let mean = near.iter().map(square).sum::<f64>() / near.len().max(1) as f64;
        (self.told(t_s - late_s).0 + value, mean.sqrt())
    }
}

/// Value at 0 and slope of the line that fits best; the mean of fewer than a line needs.
fn line(points: &[(f64, f64)]) -> (f64, f64) {
    let n = points.len() as f64;
    if points.is_empty() {
        return (0.0, 0.0);
    }
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let squares: f64 = points.iter().map(|p| (p.0 - x).powi(2)).sum();
    if points.len() < FEWEST || squares <= 0.0 {
        return (y, 0.0);
    }
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / squares;
    (y - slope * x, slope)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    const COUNT: f64 = TAU / 4096.0;
    const PROFILE: Profile = Profile {
        velocity_rad_s: 1.0,
        acceleration_rad_s2: 3.5,
    };

    /// An arm that follows 8 ms late and changes its speed on the way, seen in whole counts every 5 ms.
    #[test]
    fn an_angle_is_known_to_a_small_part_of_a_count() {
        let (late_s, goal) = (0.008, 1.2);
        let slow = Profile {
            velocity_rad_s: 0.1,
            ..PROFILE
        };
        let mut truth = Track::resting(0.0, PROFILE);
        let mut track = Track::resting(0.0, PROFILE);
        let profiles = [(0.1, PROFILE), (0.6, slow), (1.5, PROFILE)];
        for (t_s, profile) in profiles {
            truth.steer(t_s, goal, profile);
            track.steer(t_s, goal, profile);
        }
        let arm = |t_s: f64| truth.told(t_s - late_s).0;
        for i in 0..500 {
            let t_s = f64::from(i) * 0.005;
            track.saw(t_s, (arm(t_s) / COUNT).round() * COUNT);
        }
        assert!(
            (track.late_s() - late_s).abs() < 5e-4,
            "{} s late",
            track.late_s()
        );
        let errors = (10..240)
            .map(|i| f64::from(i) * 0.01)
            .map(|t_s| track.at(t_s).0 - arm(t_s));
        let errors: Vec<f64> = errors.collect();
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        let worst = errors.iter().fold(0.0, |worst: f64, e| worst.max(e.abs()));
        println!("rms {:.3} counts, worst {:.3}", rms / COUNT, worst / COUNT);
        assert!(
            rms < 0.15 * COUNT && worst < 0.5 * COUNT,
            "rms {rms}, worst {worst} rad"
        );
    }

    #[test]
    fn an_angle_is_foreseen() {
        let mut track = Track::resting(0.5, PROFILE);
        track.steer(2.0, -0.5, PROFILE);
        for angle in [0.4, 0.0, -0.4] {
            let at_s = track.when(angle);
            assert!(
                (track.expected(at_s) - angle).abs() < 1e-9,
                "{angle} rad at {at_s} s"
            );
        }
        assert!((track.when(-2.0) - 2.0 - PROFILE.duration_s(1.0)).abs() < 1e-6);
    }

    /// The arm is still before the angle at which it was told another speed.
    #[test]
    fn what_a_late_arm_has_still_to_pass_is_foreseen_across_a_turn_of_its_profile() {
        let late_s = 0.02;
        let mut track = Track::resting(0.0, PROFILE);
        track.steer(0.0, 2.0, PROFILE);
        for i in 0..160 {
            let t_s = f64::from(i) * 0.005;
            track.saw(t_s, track.told(t_s - late_s).0);
        }
        let slower = Profile {
            velocity_rad_s: 0.5,
            ..PROFILE
        };
        track.steer(0.8, 2.0, slower);
        let (actual, told) = (track.expected(0.8), track.told(0.8).0);
        for share in [0.25, 0.5, 0.75, 1.5] {
            let angle = actual + share * (told - actual);
            let at_s = track.when(angle);
            assert!(at_s > 0.8, "{angle} rad at {at_s} s, which is over");
            assert!(
                (track.expected(at_s) - angle).abs() < 1e-6,
                "{angle} rad at {at_s} s"
            );
        }
    }
}
