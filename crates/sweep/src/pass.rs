use arms::{Arm, Pose, Profile};

use crate::Mechanics;
use crate::cell::cells;

/// Fewest poses that are worth a pass.
const FEWEST: usize = 3;
/// By how many steps of a servo the ways of two arms may differ that move alike.
const ALIKE_STEPS: f64 = 1.5;

/// Seconds from each pose of a pass to the next (0 for the first), in flight from rest to rest; `None` where it cannot be
/// flown: fewer than three poses, arms that would not move alike, or a stretch between its ends that the envelope forbids.
///
/// Each pose has its cell, half-way to its neighbours, in which its light is collected; the arms go no faster than that,
/// and no faster than their profile. Where the arms could meet if one of them stood still, each is sent no farther than is
/// safe from where the other measurably is; then the way from each pose to the next must be free, and the time that this may
/// cost is left out.
pub(crate) fn pass(mechanics: &Mechanics, poses: &[Pose]) -> Option<Vec<f64>> {
    let (first, last) = (*poses.first()?, *poses.last()?);
    let way = |pose: &Pose, arm: Arm| (pose.angle(arm) - first.angle(arm)).abs();
    let lead = lead(first, last);
    let sound = poses.len() >= FEWEST && together(mechanics, poses, lead) && free(mechanics, poses);
    let along: Vec<f64> = poses.iter().map(|pose| way(pose, lead)).collect();
    let onward = along.windows(2).all(|pair| pair[0] < pair[1]);
    let margin_rad = mechanics.margin_rad + mechanics.tolerance_rad;
    let widths: Vec<f64> = cells(poses, lead, &mechanics.envelope, margin_rad)
        .into_iter()
        .map(|[low, high]| (high - low).max(mechanics.resolution_rad[lead as usize]))
        .collect();
    let profile = mechanics.profiles[lead as usize];
    (sound && onward).then(|| seconds(&along, &widths, profile, mechanics.flight_s))
}

/// The arm that goes farther from one pose to another.
pub(crate) fn lead(from: Pose, to: Pose) -> Arm {
    let way = |arm: Arm| (to.angle(arm) - from.angle(arm)).abs();
    match way(Arm::Light) >= way(Arm::Sensor) {
        true => Arm::Light,
        false => Arm::Sensor,
    }
}

/// Whether nothing is in the way of the arms from each pose to the next.
fn free(mechanics: &Mechanics, poses: &[Pose]) -> bool {
    let safe = |from: Pose, to: Pose| mechanics.envelope.check_path(from, to).is_ok();
    let (Some(&first), Some(&last)) = (poses.first(), poses.last()) else {
        return false;
    };
    safe(first, last) || poses.windows(2).all(|pair| safe(pair[0], pair[1]))
}

/// Whether the other arm stands, or goes the same share of its way as the lead at every pose, on the same servo and profile.
fn together(mechanics: &Mechanics, poses: &[Pose], lead: Arm) -> bool {
    let other = match lead {
        Arm::Light => Arm::Sensor,
        Arm::Sensor => Arm::Light,
    };
    let way = |pose: &Pose, arm: Arm| (pose.angle(arm) - poses[0].angle(arm)).abs();
    if poses.iter().all(|pose| way(pose, other) == 0.0) {
        return true;
    }
    let resolution = mechanics.resolution_rad;
    let last = poses[poses.len() - 1];
    let ratio = way(&last, other) / way(&last, lead);
    let alike =
        |pose: &Pose| (ratio * way(pose, lead) - way(pose, other)).abs() <= ALIKE_STEPS * resolution[0];
    mechanics.profiles[0] == mechanics.profiles[1]
        && resolution[0] == resolution[1]
        && poses.iter().all(alike)
}

/// Times between places along a way, rad, with `reading_s` for each, in which the arms go no further than its width, rad.
fn seconds(along: &[f64], widths: &[f64], profile: Profile, reading_s: f64) -> Vec<f64> {
    let (fastest, a) = (profile.velocity_rad_s, profile.acceleration_rad_s2);
    let last = along.len() - 1;
    let allowed = |i: usize| {
        let cell = (along[(i + 1).min(last)] - along[i.saturating_sub(1)]) / 2.0;
        fastest.min(cell.min(widths[i]) / reading_s.max(f64::MIN_POSITIVE))
    };
    let mut speeds: Vec<f64> = (0..=last).map(allowed).collect();
    (speeds[0], speeds[last]) = (0.0, 0.0);
    let reachable = |speed: f64, way: f64| (speed * speed + 2.0 * a * way).sqrt();
    for i in 1..=last {
        speeds[i] = speeds[i].min(reachable(speeds[i - 1], along[i] - along[i - 1]));
    }
    for i in (0..last).rev() {
        speeds[i] = speeds[i].min(reachable(speeds[i + 1], along[i + 1] - along[i]));
    }
    let leg = |i: usize| {
        let (from, to, way) = (speeds[i], speeds[i + 1], along[i + 1] - along[i]);
        let cap = allowed(i).max(allowed(i + 1)).max(from).max(to);
        let peak = cap.min(((from * from + to * to) / 2.0 + a * way).sqrt());
        let ramps_s = (2.0 * peak - from - to) / a;
        let ramps = (2.0 * peak * peak - from * from - to * to) / (2.0 * a);
        ramps_s + (way - ramps).max(0.0) / peak
    };
    std::iter::once(0.0).chain((0..last).map(leg)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pass_without_light_takes_its_profile() {
        let profile = Profile {
            velocity_rad_s: 1.0,
            acceleration_rad_s2: 3.5,
        };
        for way in [0.1, 0.5, 2.5] {
            for n in [3_u32, 10, 200] {
                let along: Vec<f64> = (0..=n).map(|i| way * f64::from(i) / f64::from(n)).collect();
                let taken: f64 = seconds(&along, &[way; 201], profile, 0.0).iter().sum();
                let straight = profile.duration_s(way);
                assert!(
                    (taken / straight - 1.0).abs() < 1e-9,
                    "{way} rad in {n}: {taken} s, {straight} s"
                );
            }
        }
    }

    #[test]
    fn light_takes_its_time_in_each_cell() {
        let profile = Profile {
            velocity_rad_s: 1.0,
            acceleration_rad_s2: f64::MAX,
        };
        let along: Vec<f64> = (0..=100).map(|i| f64::from(i) * 0.01).collect();
        let taken: f64 = seconds(&along, &[1.0; 101], profile, 0.05).iter().sum();
        assert!((taken - 100.0 * 0.05).abs() < 0.15, "{taken} s");
    }
}
