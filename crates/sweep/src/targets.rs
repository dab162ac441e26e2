use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use arms::{Arm, ArmAngle, Pose};

use crate::reach::{Hindrance, Reach};
use crate::{Arc, Job, LeftOut, Sweep, SweepError};

/// The poses of one sweep, in the order of its angle, and what it leaves out.
#[derive(Clone, Debug)]
pub(crate) struct Targets {
    pub(crate) sweep: Sweep,
    pub(crate) poses: Vec<Pose>,
    pub(crate) left_out: Vec<LeftOut>,
}

/// Poses along one degree of freedom, ascending, cut into stretches where all can be measured or all are hindered
/// in the same way.
pub(crate) struct Stretches {
    poses: Vec<Pose>,
    stretches: Vec<(Range<usize>, Option<Hindrance>)>,
}

impl Stretches {
    pub(crate) fn new(reach: Reach<'_>, poses: impl Iterator<Item = Pose>) -> Self {
        let poses: Vec<Pose> = poses.collect();
        let mut stretches: Vec<(Range<usize>, Option<Hindrance>)> = Vec::new();
        for (i, &pose) in poses.iter().enumerate() {
            let hindrance = reach.check(pose).err();
            match stretches.last_mut() {
                Some((range, last)) if *last == hindrance => range.end = i + 1,
                _ => stretches.push((i..i + 1, hindrance)),
            }
        }
        Self { poses, stretches }
    }

    /// The stretches that can be measured, by the places of their poses.
    fn free(&self) -> impl Iterator<Item = &Range<usize>> {
        let free = self.stretches.iter().filter(|(_, hindrance)| hindrance.is_none());
        free.map(|(range, _)| range)
    }

    fn reachable(&self) -> impl Iterator<Item = &[Pose]> {
        self.free().map(|range| &self.poses[range.clone()])
    }

    /// The longest stretch that can be measured, by the places of its poses.
    pub(crate) fn longest(&self) -> Option<Range<usize>> {
        self.free().max_by_key(|range| range.len()).cloned()
    }

    /// What hinders most of the poses, in words.
    pub(crate) fn why_not(&self, reach: Reach<'_>) -> String {
        let most = self.stretches.iter().max_by_key(|(range, _)| range.len());
        most.and_then(|(_, hindrance)| hindrance.as_ref()).map_or_else(
            || "no pose has that deviation".to_owned(),
            |hindrance| reach.why(hindrance),
        )
    }

    /// The hindered stretches in words; their readings went to the rest of the sweep.
    pub(crate) fn left_out(&self, reach: Reach<'_>, sweep: &str, arm: Arm) -> Vec<LeftOut> {
        let describe = |(range, hindrance): &(Range<usize>, Option<Hindrance>)| {
            let [first, last] = [range.start, range.end - 1].map(|i| self.poses[i].angle(arm).deg());
            Some(LeftOut {
                what: format!("{sweep}, {arm} {first:.1}° … {last:.1}°"),
                why: reach.why(hindrance.as_ref()?),
                readings: 0,
                seconds: 0.0,
            })
        };
        self.stretches.iter().filter_map(describe).collect()
    }
}

/// Poses of plane `index` of a job: the sensor stands, the light takes the d_p of the plane's distribution on both
/// sides of the mirror direction; the one nearest to the arc's offset is put where the arc crosses the plane, so
/// that both sweeps share that pose.
pub(crate) fn plane(job: &Job, index: usize, reach: Reach<'_>) -> Result<Targets, SweepError> {
    let plane = &job.planes[index];
    let mechanics = reach.mechanics;
    let name = format!("plane {:.1}°", plane.theta_r.to_degrees());
    let sensor = mechanics.nearest(Arm::Sensor, ArmAngle::from_rad(plane.theta_r));
    let light = |angle| Pose { light: angle, sensor };
    let quarter = ArmAngle::from_rad(FRAC_PI_2);
    let stretches = Stretches::new(reach, mechanics.angles(Arm::Light, -quarter, quarter).map(light));
    if stretches.reachable().next().is_none() {
        let theta_r_deg = plane.theta_r.to_degrees();
        return Err(SweepError::Unreachable {
            file: job.name.clone(),
            key: format!("plane[{index}].theta_r_deg"),
            why: format!(
                "nothing can be measured at {theta_r_deg:.1}°: {}",
                stretches.why_not(reach)
            ),
        });
    }
    let mut left_out = stretches.left_out(reach, &name, Arm::Light);
    let ranges = stretches
        .reachable()
        .map(|poses| poses[0].deviation()..=poses[poses.len() - 1].deviation());
    let spread = pdv::spread(
        plane.distribution,
        sensor.rad(),
        &ranges.collect::<Vec<_>>(),
        plane.readings,
        mechanics.resolution_rad[Arm::Light as usize],
    );
    let mut poses: Vec<Pose> = spread
        .deviations
        .into_iter()
        .map(|d| light(mechanics.nearest(Arm::Light, ArmAngle::from_rad(at_deviation(d, sensor)))))
        .filter(|&pose| reach.check(pose).is_ok())
        .collect();
    let crossing = job.arc.map_or(0.0, |arc| arc.offset);
    let crossing = light(mechanics.nearest(Arm::Light, ArmAngle::from_rad(at_deviation(crossing, sensor))));
    if reach.check(crossing).is_ok() {
        pin(&mut poses, crossing, Arm::Light);
    }
    poses.dedup();
    let missing = plane.readings.saturating_sub(poses.len());
    left_out.extend(too_close(missing, &name, "values of d_p"));
    Ok(Targets {
        sweep: Sweep::Plane(index),
        poses,
        left_out,
    })
}

/// Poses of the mirror arc: sensor at +θ, light where the deviation is the offset, evenly over all θ that can be
/// measured. The θ nearest to each plane is that plane's, so that both sweeps share a pose.
pub(crate) fn arc(job: &Job, arc: &Arc, reach: Reach<'_>) -> Result<Targets, SweepError> {
    let mechanics = reach.mechanics;
    let pose = |sensor| {
        let light = ArmAngle::from_rad(at_deviation(arc.offset, sensor));
        Pose {
            light: mechanics.nearest(Arm::Light, light),
            sensor,
        }
    };
    let quarter = ArmAngle::from_rad(FRAC_PI_2);
    let exists = |sensor: &ArmAngle| (arc.offset - sensor.rad().sin()).abs() <= 1.0;
    let sensors = mechanics
        .angles(Arm::Sensor, ArmAngle::NORMAL, quarter)
        .filter(exists);
    let stretches = Stretches::new(reach, sensors.map(pose));
    let free: Vec<Pose> = stretches.reachable().flatten().copied().collect();
    if free.is_empty() {
        return Err(SweepError::Unreachable {
            file: job.name.clone(),
            key: "arc.offset".to_owned(),
            why: format!(
                "nothing can be measured at {}: {}",
                arc.offset,
                stretches.why_not(reach)
            ),
        });
    }
    let mut left_out = stretches.left_out(reach, "arc", Arm::Sensor);
    let spacing = (free.len() - 1) as f64 / (arc.readings.max(2) - 1) as f64;
    let mut poses: Vec<Pose> = (0..arc.readings)
        .map(|i| free[((i as f64 * spacing).round() as usize).min(free.len() - 1)])
        .collect();
    poses.dedup();
    for plane in &job.planes {
        let crossing = pose(mechanics.nearest(Arm::Sensor, ArmAngle::from_rad(plane.theta_r)));
        if free.contains(&crossing) {
            pin(&mut poses, crossing, Arm::Sensor);
        }
    }
    poses.dedup();
    let missing = arc.readings.saturating_sub(poses.len());
    left_out.extend(too_close(missing, "arc", "values of θ_r"));
    Ok(Targets {
        sweep: Sweep::Arc,
        poses,
        left_out,
    })
}

/// What a sweep leaves out since its servos cannot tell so many poses apart; nothing where it has them all.
pub(crate) fn too_close(missing: usize, sweep: &str, what: &str) -> Option<LeftOut> {
    (missing > 0).then(|| LeftOut {
        what: format!("{sweep}, {missing} {what}"),
        why: "closer than one servo count to their neighbours".to_owned(),
        readings: missing,
        seconds: 0.0,
    })
}

/// Arm angle at which the light deviates by `d` from the mirror direction of the sensor, rad: sin α_light = d −
/// sin α_sensor, clamped to ±π/2 against rounding at the rim.
fn at_deviation(d: f64, sensor: ArmAngle) -> f64 {
    (d - sensor.rad().sin()).clamp(-1.0, 1.0).asin()
}

/// Moves the pose nearest to `to`, judged by one arm, to it.
fn pin(poses: &mut [Pose], to: Pose, arm: Arm) {
    let distance = |pose: &Pose| (pose.angle(arm) - to.angle(arm)).abs();
    if let Some(nearest) = poses
        .iter_mut()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
    {
        *nearest = to;
    }
}
