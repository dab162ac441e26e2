use arms::{Arm, ArmAngle, Pose, Trajectory};
use serde::Serialize;

use crate::pass::lead;
use crate::reach::Reach;
use crate::targets::{Stretches, Targets, too_close};
use crate::{Job, Mechanics, Sweep, SweepError};

/// Time between two readings of a leg far from the mirror direction, s: thirty a second are nearly as good as any number.
const EVERY_S: f64 = 1.0 / 30.0;
/// Half angle, rad, below which readings come faster, in proportion to it, and what is added to it there: 5° and 0.5°.
const NEAR_RAD: f64 = 0.087;
const NEAREST_RAD: f64 = 0.0087;
/// Time between two readings at least, in those that a reading in flight is expected to take: the next one may be fainter.
const SPARE: f64 = 1.3;
/// Places at which time is counted along a leg.
const FINE: usize = 4000;

/// A straight line in half and difference angle, along which both arms move at once.
///
/// In the plane of the arms the light stands at half − difference, the sensor at half + difference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Leg {
    /// Signed half angle at either end, rad.
    pub half: [f64; 2],
    /// Difference angle at either end, rad, ≥ 0.
    pub difference: [f64; 2],
    /// Readings along it; `None`: as many as a flight at the arms' own speed can take.
    pub readings: Option<usize>,
}

impl Leg {
    /// Numbers of legs of which [`Leg::snake`] is known.
    pub const SNAKES: [usize; 3] = [3, 6, 10];

    /// Legs that go on where the one before ends and cover the whole plane of the arms, each across the mirror direction; of
    /// 3, 6 or 10 legs. `None` for any other number.
    ///
    /// The corners of 3 and 6 legs were found by search over materials; those of 10 put further legs between them.
    pub fn snake(legs: usize) -> Option<Vec<Self>> {
        let corners_deg: &[[f64; 2]] = match legs {
            3 => &[[-3.0, 8.0], [60.0, 25.0], [-3.0, 45.0], [20.0, 65.0]],
            6 => &[
                [-3.0, 5.0],
                [70.0, 15.0],
                [-3.0, 30.0],
                [43.0, 42.0],
                [-3.0, 55.0],
                [18.0, 67.0],
                [-3.0, 78.0],
            ],
            10 => &[
                [-3.0, 5.0],
                [75.0, 10.0],
                [-3.0, 20.0],
                [60.0, 25.0],
                [-3.0, 35.0],
                [45.0, 40.0],
                [-3.0, 50.0],
                [30.0, 55.0],
                [-3.0, 65.0],
                [12.0, 73.0],
                [-3.0, 80.0],
            ],
            _ => return None,
        };
        let leg = |ends: &[[f64; 2]]| Self {
            half: [ends[0][0].to_radians(), ends[1][0].to_radians()],
            difference: [ends[0][1].to_radians(), ends[1][1].to_radians()],
            readings: None,
        };
        Some(corners_deg.windows(2).map(leg).collect())
    }

    /// Where the arms are at a share 0 … 1 of the way.
    pub fn pose(&self, share: f64) -> Pose {
        let at = |[from, to]: [f64; 2]| from + share * (to - from);
        let (half, difference) = (at(self.half), at(self.difference));
        Pose {
            light: ArmAngle::from_rad(half - difference),
            sensor: ArmAngle::from_rad(half + difference),
        }
    }
}

/// Poses of leg `index` of a job, in its direction: so that a flight at the arms' own speed comes to them evenly in time, but
/// more often near the mirror direction. Where a stretch of it cannot be measured, the longest other stretch is taken.
pub(crate) fn leg(job: &Job, index: usize, reach: Reach<'_>) -> Result<Targets, SweepError> {
    let leg = &job.legs[index];
    let mechanics = reach.mechanics;
    let on_grid = |share: f64| mechanics.nearest_pose(leg.pose(share));
    let share = |i: usize| i as f64 / FINE as f64;
    let stretches = Stretches::new(reach, (0..=FINE).map(|i| on_grid(share(i))));
    let Some(free) = stretches.longest() else {
        return Err(SweepError::Unreachable {
            file: job.name.clone(),
            key: format!("leg[{index}]"),
            why: format!("nothing of it can be measured: {}", stretches.why_not(reach)),
        });
    };
    let sweep = Sweep::Leg(index);
    let mut left_out = stretches.left_out(reach, &sweep.to_string(), Arm::Sensor);
    let stretch = [share(free.start), share(free.end - 1)];
    let lead = lead(leg.pose(stretch[0]), leg.pose(stretch[1]));
    let shares = shares(leg, stretch, lead, mechanics);
    let mut poses: Vec<Pose> = shares.into_iter().map(on_grid).collect();
    let asked = poses.len();
    // Nor may the arm that goes farther stand from one to the next.
    let end = poses.last().copied();
    poses.dedup_by(|a, b| a.angle(lead) == b.angle(lead));
    // The next leg begins where this one ends.
    if let (Some(last), Some(end)) = (poses.last_mut(), end) {
        *last = end;
    }
    if leg.readings.is_some() {
        left_out.extend(too_close(asked - poses.len(), &sweep.to_string(), "readings"));
    }
    Ok(Targets {
        sweep,
        poses,
        left_out,
    })
}

/// Shares of the way of a leg at which it is read, between two of them; `lead` is the arm that goes farther.
fn shares(leg: &Leg, [from, to]: [f64; 2], lead: Arm, mechanics: &Mechanics) -> Vec<f64> {
    let length = (leg.pose(to).angle(lead) - leg.pose(from).angle(lead)).abs();
    let motion = Trajectory::new(0.0, 0.0, length, mechanics.profiles[lead as usize]);
    let duration_s = motion.duration_s();
    let least_s = SPARE * mechanics.flight_s;
    let most_s = EVERY_S.max(least_s);
    let at = |i: usize| {
        let t_s = duration_s * i as f64 / FINE as f64;
        let share = if length > 0.0 {
            motion.at(t_s).0 / length
        } else {
            0.0
        };
        from + share * (to - from)
    };
    // How many readings there are until each moment.
    let mut until = 0.0;
    let count: Vec<(f64, f64)> = (0..=FINE)
        .map(|i| {
            let share = at(i);
            let pose = leg.pose(share);
            let half = (pose.light.rad() + pose.sensor.rad()).abs() / 2.0;
            let every_s = (most_s * (half + NEAREST_RAD) / NEAR_RAD).clamp(least_s, most_s);
            let before = until;
            until += duration_s / FINE as f64 / every_s;
            (before, share)
        })
        .collect();
    let all = count[FINE].0;
    let readings = leg.readings.unwrap_or(all as usize + 1).max(2);
    (0..readings)
        .map(|k| {
            let wanted = all * k as f64 / (readings - 1) as f64;
            count[count.partition_point(|&(n, _)| n < wanted).min(FINE)].1
        })
        .collect()
}
