use crate::separable::{THETA_R_SPREAD, steady};
use crate::sweeps::Point;
use crate::{Error, Observation};

/// Half angle, rad, from one place to the next at which the course of a leg is known.
const STEP: f64 = 0.01;
/// How far two neighbours of a leg may lie apart in difference angle, rad, beside twice their way in half angle: arms do not
/// keep step exactly, but neither jumps.
const JUMP: f64 = 0.12;

/// Where a curve of readings runs through the plane of the arms: θ_d over the signed half angle, rad.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Course {
    /// The sensor stands at θ_r, rad.
    Plane { theta_r: f64 },
    /// Both arms move: θ_d at half angles evenly apart, the first at `from`, and as at the ends beyond them.
    Leg { from: f64, difference: Vec<f64> },
}

impl Course {
    /// The course of readings: a plane, where their θ_r differ by no more than 0.02 rad, else a leg.
    ///
    /// # Errors
    /// They are neither, since θ_d jumps.
    pub(crate) fn of(readings: &[Observation], points: &[Point]) -> Result<Self, Error> {
        let theta_r = steady(
            "θ_r of a plane, in rad,",
            readings.iter().map(|o| o.theta_r),
            THETA_R_SPREAD,
        );
        let mixed = match theta_r {
            Ok(theta_r) => return Ok(Self::Plane { theta_r }),
            Err(mixed) => mixed,
        };
        let mut along: Vec<(f64, f64)> = points.iter().map(|p| (p.theta_h, p.theta_d)).collect();
        along.sort_by(|a, b| a.0.total_cmp(&b.0));
        let follows = |pair: &[(f64, f64)]| {
            let [half, difference] = [pair[1].0 - pair[0].0, (pair[1].1 - pair[0].1).abs()];
            difference <= 2.0 * half + JUMP
        };
        let (Some(&first), Some(&last)) = (along.first(), along.last()) else {
            return Err(mixed);
        };
        if !along.windows(2).all(follows) {
            return Err(mixed);
        }
        let steps = ((last.0 - first.0) / STEP).ceil() as usize;
        let at = |theta_h: f64| {
            let next = along
                .partition_point(|&(half, _)| half < theta_h)
                .min(along.len() - 1);
            let (a, b) = (along[next.saturating_sub(1)], along[next]);
            let share = if b.0 > a.0 {
                (theta_h - a.0) / (b.0 - a.0)
            } else {
                0.0
            };
            a.1 + share.clamp(0.0, 1.0) * (b.1 - a.1)
        };
        Ok(Self::Leg {
            from: first.0,
            difference: (0..=steps).map(|n| at(first.0 + n as f64 * STEP)).collect(),
        })
    }

    /// θ_d at a signed half angle, rad.
    #[inline]
    pub(crate) fn theta_d(&self, theta_h: f64) -> f64 {
        match self {
            Self::Plane { theta_r } => (theta_r - theta_h).abs(),
            Self::Leg { from, difference } => {
                let place = ((theta_h - from) / STEP).clamp(0.0, (difference.len() - 1) as f64);
                let n = (place as usize).min(difference.len().saturating_sub(2));
                let (a, b) = (difference[n], difference[(n + 1).min(difference.len() - 1)]);
                a + (place - n as f64) * (b - a)
            }
        }
    }
}
