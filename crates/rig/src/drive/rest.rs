use std::time::Duration;

use arms::{Arm, ArmAngle, Pose};

/// Where arms at rest are: what several looks saw, since an arm that is held trembles and its encoder is noisy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// Mean of what was seen.
    pub pose: Pose,
    /// Between the smallest and the largest angle that was seen, rad: light, sensor.
    pub spread_rad: [f64; 2],
}

impl Rest {
    /// The first arm that moved by more than a given angle (rad; light, sensor) between the looks.
    pub fn moved(&self, allowed_rad: [f64; 2]) -> Option<Arm> {
        Arm::BOTH
            .into_iter()
            .find(|&arm| self.spread_rad[arm as usize] > allowed_rad[arm as usize])
    }
}

/// Looks at arms, oldest first, and when each was taken.
#[derive(Clone, Debug, Default)]
pub(super) struct Looks(Vec<(Duration, Pose)>);

impl Looks {
    /// Adds a look.
    pub(super) fn push(&mut self, at: Duration, pose: Pose) {
        self.0.push((at, pose));
    }

    /// Whether nobody has looked yet.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// What the looks of the last stretch of time saw; `None` where they do not reach back so far.
    pub(super) fn over(&self, window: Duration) -> Option<Rest> {
        let &(last, _) = self.0.last()?;
        let reaches = self.0.first().is_some_and(|&(first, _)| first + window <= last);
        reaches.then(|| self.rest(|at| at + window >= last))
    }

    /// By how much each arm's mean changed from the first to the second half of the last stretch of time, rad.
    pub(super) fn drift_rad(&self, window: Duration) -> Option<[f64; 2]> {
        let &(last, _) = self.0.last()?;
        self.over(window)?;
        let earlier = |at: Duration| at + window >= last && at + window / 2 < last;
        self.0.iter().any(|&(at, _)| earlier(at)).then_some(())?;
        let earlier = self.rest(earlier);
        let later = self.rest(|at| at + window / 2 >= last);
        Some(Arm::BOTH.map(|arm| later.pose.angle(arm) - earlier.pose.angle(arm)))
    }

    /// What all looks saw; of none the normal.
    pub(super) fn all(&self) -> Rest {
        self.rest(|_| true)
    }

    fn rest(&self, counts: impl Fn(Duration) -> bool) -> Rest {
        let of = |arm: Arm| {
            let angles = self.0.iter().filter(|(at, _)| counts(*at));
            let angles: Vec<f64> = angles.map(|(_, pose)| pose.angle(arm).rad()).collect();
            let low = angles.iter().copied().fold(f64::INFINITY, f64::min);
            let high = angles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let mean = angles.iter().sum::<f64>() / angles.len().max(1) as f64;
            (ArmAngle::from_rad(mean), (high - low).max(0.0))
        };
        let [light, sensor] = Arm::BOTH.map(of);
        Rest {
            pose: Pose {
                light: light.0,
                sensor: sensor.0,
            },
            spread_rad: [light.1, sensor.1],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looks(light_deg: impl Fn(f64) -> f64) -> Looks {
        let mut looks = Looks::default();
        for ms in 0..100_u32 {
            let pose = Pose::from_deg(light_deg(f64::from(ms) / 1e3), 45.0);
            looks.push(Duration::from_millis(ms.into()), pose);
        }
        looks
    }

    #[test]
    fn looks_say_where_arms_are_how_far_they_spread_and_whether_they_go_somewhere() {
        let window = Duration::from_millis(50);
        let creeping = looks(|s| -40.0 + 2.0 * s);
        let rest = creeping.over(window).unwrap();
        assert!((rest.pose.light.deg() + 39.852).abs() < 1e-3, "{rest:?}");
        assert!((rest.spread_rad[0].to_degrees() - 0.1).abs() < 1e-6, "{rest:?}");
        assert_eq!(rest.moved([0.01, 0.01]), None);
        assert_eq!(rest.moved([0.001, 0.001]), Some(Arm::Light));
        let drift = creeping.drift_rad(window).unwrap()[0].to_degrees();
        assert!((drift - 0.051).abs() < 2e-3, "{drift}");
        assert!(
            creeping.over(Duration::from_millis(100)).is_none(),
            "they do not reach back so far"
        );
        // Whole periods: to and fro, and nowhere.
        let hunting = looks(|s| -40.0 + (s * 80.0 * std::f64::consts::PI).sin());
        assert!(hunting.drift_rad(window).unwrap()[0].to_degrees().abs() < 0.1);
    }
}
