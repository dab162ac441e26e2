use arms::{Arm, ArmAngle, Pose};
use brdf::Brdf;
use glam::DVec3;
use pdv::InPlane;
use rig::{Filling, RigFile};
use sweep::Sweep;

use crate::measurement::{observation, visits};
use crate::uncertainty::COVERAGE;
use crate::{Measurement, observations};

/// Half of the step, rad, by which a slope is found: a third of the width that apertures of a quarter of a degree leave
/// of a mirror's lobe, and more than any rig's angles are unsure.
const STEP: f64 = 1e-3;
/// The largest share of its height that a lobe's peak may lose to the apertures before it counts as lost altogether: at
/// that share a lobe is about as wide as the apertures, and what it was before cannot be told from its width any more.
const MOST_LOST: f64 = 0.45;
/// How many times of what the readings say was lost an interval must reach: of chrome, steel and brass, read by
/// config/jobs/three-planes.toml, the apertures take 1.2 to 1.3 times as much of the peaks.
const BEYOND: f64 = 1.5;
/// The least reflectance, sr⁻¹, that has a logarithm.
const LEAST: f64 = 1e-9;

/// How a reflectance changes with each arm's angle and what the apertures blur, by the lobe that the readings show.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sensitivity {
    /// By how much the reported reflectance is off for each radian that the light and the sensor arm really stand
    /// further than it was taken; sr⁻¹/rad.
    pub(crate) arms: [DVec3; 2],
    /// What the apertures take from a peak, or add beside it, sr⁻¹.
    pub(crate) aperture: DVec3,
}

/// The sensitivities of all measurements; those of no use have none.
///
/// Slopes are those of ln f, which between two readings never passes either: in f itself a parabola through three readings
/// that are many widths of a lobe apart has slopes that no lobe has.
pub(crate) fn sensitivities(measurements: &[Measurement], rig: &RigFile) -> Vec<Sensitivity> {
    let mut found = vec![Sensitivity::default(); measurements.len()];
    let mut sweeps: Vec<Sweep> = measurements.iter().map(|m| m.reading.sweep).collect();
    sweeps.sort_by_key(|sweep| match sweep {
        Sweep::Plane(index) => *index,
        _ => usize::MAX,
    });
    sweeps.dedup();
    let Some(lobe) = lobe(measurements, &sweeps) else {
        return found;
    };
    for sweep in sweeps {
        for visit in visits(measurements, sweep) {
            let Some(f) = observation(measurements, &visit, Measurement::rgb).map(|o| o.rgb) else {
                continue;
            };
            let pose = measurements[visit[0]].pose;
            let sensitivity = Sensitivity {
                arms: arms(&lobe, pose, f, rig),
                aperture: f * apertures(&lobe, pose, rig.uncertainty.apertures_rad).map(standard),
            };
            for i in visit {
                found[i] = sensitivity;
            }
        }
    }
    found
}

/// What lies between the readings of all sweeps; `None` where they are none to speak of.
fn lobe(measurements: &[Measurement], sweeps: &[Sweep]) -> Option<InPlane> {
    let planes: Vec<_> = sweeps
        .iter()
        .filter(|sweep| matches!(sweep, Sweep::Plane(_)))
        .map(|&sweep| observations(measurements, sweep))
        .collect();
    let arc = observations(measurements, Sweep::Arc);
    let made = InPlane::from_observations(&planes, &arc);
    // An arc that stands alone is a plane of peaks, between which no lobe shows.
    made.ok()
}

fn ln(f: DVec3) -> DVec3 {
    f.map(|f| f.max(LEAST).ln())
}

/// The reflectance is divided by the cosine of the angle that was read, and taken to stand at that angle.
fn arms(lobe: &InPlane, pose: Pose, f: DVec3, rig: &RigFile) -> [DVec3; 2] {
    let divided = match rig.calibration.filling {
        Filling::Over => Arm::Light,
        Filling::Under => Arm::Sensor,
    };
    Arm::BOTH.map(|arm| {
        let angle = pose.angle(arm);
        let at = |by: f64| {
            let moved = pose.with(arm, ArmAngle::from_rad(angle.rad() + by));
            ln(lobe.eval(moved.incident(), moved.exitant()))
        };
        let slope = (at(STEP) - at(-STEP)) / (2.0 * STEP);
        let cosine = if arm == divided { angle.rad().tan() } else { 0.0 };
        f * (slope - cosine)
    })
}

/// By which share the apertures have changed a reading, relative to it: above 0 where they took light away.
///
/// The lobe that the readings show is blurred already. Blurring it once more multiplies its peak by m: of a lobe whose
/// squared width the apertures have made larger by the share q, m = 1/(1 + q), and they took the share q of its height. So
/// what was lost is −ln(1 − q) = −ln(2 − 1/m) of ln f, at most as much as a lobe does that is as wide as the apertures.
fn apertures(lobe: &InPlane, pose: Pose, [source, detector]: [f64; 2]) -> DVec3 {
    let centre = lobe
        .eval(pose.incident(), pose.exitant())
        .max(DVec3::splat(LEAST));
    let mut mean = DVec3::ZERO;
    let (incident, exitant) = (disc(pose.light, source), disc(pose.sensor, detector));
    for &incident in &incident {
        for &exitant in &exitant {
            mean += lobe.eval(incident, exitant);
        }
    }
    mean /= (incident.len() * exitant.len()) as f64;
    let least = 1.0 - MOST_LOST;
    (mean / centre).map(|m| match m < 1.0 {
        true => -(2.0 - 1.0 / m.max(least)).ln(),
        false => m.ln(),
    })
}

/// What was lost of ln f as a standard uncertainty of f, relative to it, such that the expanded one reaches [`BEYOND`] times
/// as far.
fn standard(lost: f64) -> f64 {
    (BEYOND * lost.abs()).exp_m1().copysign(lost) / COVERAGE
}

/// Six directions of a disc about an arm's, evenly at the radius whose square is the mean over the disc: exact for
/// polynomials up to degree 3.
fn disc(angle: ArmAngle, half_angle_rad: f64) -> Vec<DVec3> {
    if half_angle_rad == 0.0 {
        return vec![angle.direction()];
    }
    let radius = half_angle_rad.tan() / std::f64::consts::SQRT_2;
    let (sin, cos) = angle.rad().sin_cos();
    (0..6)
        .map(|n| {
            let (across, along) = (f64::from(n) * std::f64::consts::FRAC_PI_3).sin_cos();
            let towards = DVec3::new(cos, 0.0, -sin) * (radius * along);
            (angle.direction() + towards + DVec3::Y * (radius * across)).normalize()
        })
        .collect()
}
