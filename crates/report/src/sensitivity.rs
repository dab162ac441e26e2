use arms::{Arm, ArmAngle, Pose};
use brdf::Brdf;
use glam::DVec3;
use pdv::InPlane;
use rig::{Filling, RigFile};
use sweep::Sweep;

use crate::measurement::{observation, visits};
use crate::uncertainty::{COVERAGE, angle_rad};
use crate::{Measurement, observations};

/// Half of the step, rad, by which a slope is found: a third of the width that apertures of a quarter of a degree leave
/// of a mirror's lobe, and more than any rig's angles are unsure.
const STEP: f64 = 1e-3;
/// The largest share of its height that a lobe's peak may lose to the apertures before it counts as lost altogether: at
/// that share a lobe is about as wide as the apertures, and what it was before cannot be told from its width any more.
const MOST_LOST: f64 = 0.45;
/// The largest change of ln f within the uncertainty of an angle that a slope is taken to tell.
const STEEPEST: f64 = 0.5;
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
    /// What an error of the angles makes of a peak, where no slope tells it: standard uncertainty, sr⁻¹.
    pub(crate) bend: DVec3,
    /// What the apertures take from a peak, or add beside it, sr⁻¹.
    pub(crate) aperture: DVec3,
}

impl Sensitivity {
    /// Of each part the one that is larger.
    fn or_more(self, other: Self) -> Self {
        let more = |a: DVec3, b: DVec3| DVec3::select(a.abs().cmpge(b.abs()), a, b);
        Self {
            arms: [0, 1].map(|arm| more(self.arms[arm], other.arms[arm])),
            bend: more(self.bend, other.bend),
            aperture: more(self.aperture, other.aperture),
        }
    }
}

/// The sensitivities of all measurements; those of no use have none.
///
/// Slopes are those of ln f, which between two readings never passes either: in f itself a parabola through three readings
/// that are many widths of a lobe apart has slopes that no lobe has.
pub(crate) fn sensitivities(measurements: &[Measurement], rig: &RigFile) -> Vec<Sensitivity> {
    let mut found = vec![Sensitivity::default(); measurements.len()];
    let mut sweeps: Vec<Sweep> = measurements.iter().map(|m| m.reading.sweep).collect();
    sweeps.sort_by_key(|sweep| match sweep {
        Sweep::Plane(index) => (0, *index),
        Sweep::Leg(index) => (1, *index),
        _ => (2, 0),
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
            let m = &measurements[visit[0]];
            let u_half_rad = u_half_rad(m, rig);
            let by = |lobe: &dyn Brdf| Sensitivity {
                arms: arms(lobe, pose, f, u_half_rad, rig),
                bend: bend(lobe, pose, f, u_half_rad),
                aperture: f * apertures(lobe, pose, rig.uncertainty.apertures_rad).map(standard),
            };
            // Between readings that are farther apart than a narrow lobe is wide, interpolation is too flat.
            let narrow = m.alignment.lobe.as_ref().map(|lobe| by(lobe));
            let sensitivity = narrow.into_iter().fold(by(&lobe), Sensitivity::or_more);
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
        .filter(|sweep| sweep.is_curve())
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
fn arms(lobe: &dyn Brdf, pose: Pose, f: DVec3, u_half_rad: f64, rig: &RigFile) -> [DVec3; 2] {
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
        // A straight line in ln f says nothing of changes by more.
        let steepest = DVec3::splat(STEEPEST / u_half_rad.max(f64::MIN_POSITIVE));
        let slope = ((at(STEP) - at(-STEP)) / (2.0 * STEP)).clamp(-steepest, steepest);
        let cosine = if arm == divided { angle.rad().tan() } else { 0.0 };
        f * (slope - cosine)
    })
}

/// Standard uncertainty of half the sum of both arms' angles, on which a lobe depends most, rad.
fn u_half_rad(m: &Measurement, rig: &RigFile) -> f64 {
    let [light, sensor] = angle_rad(m, rig);
    let common = m.alignment.variance([0.5; 2], m.reading.sweep, m.lean);
    (common + (light * light + sensor * sensor) / 4.0).sqrt()
}

/// What the reflectance is off on the average where both angles are off by √2 of an uncertainty either way: of a parabola
/// about as much as the root mean square of what they make of it, sr⁻¹.
fn bend(lobe: &dyn Brdf, pose: Pose, f: DVec3, u_half_rad: f64) -> DVec3 {
    let at = |by: f64| {
        let moved = |angle: ArmAngle| ArmAngle::from_rad(angle.rad() + by);
        let (light, sensor) = (moved(pose.light), moved(pose.sensor));
        ln(lobe.eval(light.direction(), sensor.direction()))
    };
    let by = std::f64::consts::SQRT_2 * u_half_rad;
    let centre = at(0.0);
    let mean = ((at(by) - centre).map(f64::exp) + (at(-by) - centre).map(f64::exp)) / 2.0;
    // Beyond as much as was read nobody knows more than that the reading says little.
    f * (mean - 1.0).min(DVec3::ONE)
}

/// By which share the apertures have changed a reading, relative to it: above 0 where they took light away.
///
/// The lobe that the readings show is blurred already. Blurring it once more multiplies its peak by m: of a lobe whose
/// squared width the apertures have made larger by the share q, m = 1/(1 + q), and they took the share q of its height. So
/// what was lost is −ln(1 − q) = −ln(2 − 1/m) of ln f, at most as much as a lobe does that is as wide as the apertures.
fn apertures(lobe: &dyn Brdf, pose: Pose, [source, detector]: [f64; 2]) -> DVec3 {
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
    let lost = |m: f64| -(2.0 - 1.0 / m).ln();
    let most = lost(1.0 - MOST_LOST);
    (mean / centre).map(|m| match m < 1.0 {
        true => lost(m.max(1.0 - MOST_LOST)),
        false => m.ln().min(most),
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
