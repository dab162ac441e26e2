use arms::Arm;
use glam::DVec3;
use rig::{Filling, RigFile, ZeroUncertainty};
use sweep::Sweep;

use crate::Measurement;
use crate::measurement::{certificate, observation, visits};

/// Coverage factor of what is reported: 95 % of a normal distribution.
pub const COVERAGE: f64 = 2.0;

/// How a reflectance changes with each arm's angle and what the apertures blur, by the readings next to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sensitivity {
    /// By how much the reported reflectance is off for each radian that the light and the sensor arm really stand
    /// further than it was taken; sr⁻¹/rad.
    pub(crate) arms: [DVec3; 2],
    /// What the apertures take from a peak, or add beside it, sr⁻¹.
    pub(crate) aperture: DVec3,
}

/// A reading within its sweep: the angle along which the sweep goes, rad, and the reflectance.
type Point = (f64, DVec3);

/// The sensitivities of all measurements; those of no use have none.
pub(crate) fn sensitivities(measurements: &[Measurement], rig: &RigFile) -> Vec<Sensitivity> {
    let mut found = vec![Sensitivity::default(); measurements.len()];
    let mut peak = DVec3::ZERO;
    let mut sweeps: Vec<Sweep> = measurements.iter().map(|m| m.reading.sweep).collect();
    sweeps.sort_by_key(|sweep| match sweep {
        Sweep::Plane(index) => *index,
        _ => usize::MAX,
    });
    sweeps.dedup();
    for sweep in sweeps {
        let mut members: Vec<(Vec<usize>, Point)> = visits(measurements, sweep)
            .into_iter()
            .filter_map(|visit| {
                let rgb = observation(measurements, &visit, Measurement::rgb)?.rgb;
                let light: f64 = visit.iter().map(|&i| measurements[i].pose.light.rad()).sum();
                Some((visit.clone(), (light / visit.len() as f64, rgb)))
            })
            .collect();
        members.sort_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let points: Vec<Point> = members.iter().map(|member| member.1).collect();
        let mut nearest = f64::INFINITY;
        for (place, &(ref visit, (_, f))) in members.iter().enumerate() {
            let m = &measurements[visit[0]];
            let [slope, bend] = derivatives(&points, place);
            let (slopes, blur) = match sweep {
                Sweep::Plane(_) => {
                    let blur = blur(slope, bend, m, rig);
                    if m.deviation.abs() < nearest {
                        nearest = m.deviation.abs();
                        peak =
                            blur / f.max(DVec3::splat(f64::MIN_POSITIVE)) / bends(m.pose.light.rad().cos());
                    }
                    // The deviation is sin α_light + sin α_sensor; near grazing the light hardly changes it.
                    let ratio = m.pose.sensor.rad().cos() / m.pose.light.rad().cos().max(1e-3);
                    ([slope, slope * ratio], blur)
                }
                // Along the arc the lobe's width does not show; about the half vector it is that of the planes. Its slope is
                // that over the angle between the arms, of which each has a half; the top of the lobe has none.
                _ => {
                    let blur = (peak * bends(m.pose.light.rad().cos())).clamp(-DVec3::ONE, DVec3::ONE);
                    ([slope / 2.0, slope / -2.0], blur * f)
                }
            };
            for &i in visit {
                found[i] = Sensitivity {
                    arms: arms(slopes, f, m, rig),
                    aperture: blur,
                };
            }
        }
    }
    found
}

/// First and second derivative at a point of a sweep by the parabola through it and its neighbours; at the ends, and
/// in sweeps of fewer than three readings, by what there is.
fn derivatives(points: &[Point], at: usize) -> [DVec3; 2] {
    if points.len() < 3 {
        return [DVec3::ZERO; 2];
    }
    let middle = at.clamp(1, points.len() - 2);
    let [a, b, c] = [points[middle - 1], points[middle], points[middle + 1]];
    let (h, k) = (b.0 - a.0, c.0 - b.0);
    // The same pose measured again says nothing of a slope.
    if h <= f64::EPSILON || k <= f64::EPSILON {
        return [DVec3::ZERO; 2];
    }
    let (left, right) = ((b.1 - a.1) / h, (c.1 - b.1) / k);
    let bend = 2.0 * (right - left) / (h + k);
    let slope = (left * k + right * h) / (h + k) + bend * (points[at].0 - b.0);
    [slope, bend]
}

/// What a disc of directions at source and detector makes of a lobe that depends on the deviation alone: an eighth of
/// the squared half angles times the sum of its second derivatives along and across the plane.
fn blur(slope: DVec3, bend: DVec3, m: &Measurement, rig: &RigFile) -> DVec3 {
    let [source, detector] = rig.uncertainty.apertures_rad;
    let cosine = m.pose.light.rad().cos().max(1e-3);
    let across = match m.deviation.abs() {
        // The limit of what follows.
        deviation if deviation <= source + detector => bend / (cosine * cosine),
        _ => slope / (cosine * m.pose.deviation()),
    };
    (source * source + detector * detector) / 8.0 * (bend + across)
}

/// Second derivatives of a lobe about the half vector at its centre, along and across the plane, together, relative to
/// the one along: an angle along the plane tilts the half vector by a half of it, one across it by that over the cosine.
fn bends(cosine: f64) -> f64 {
    1.0 + 1.0 / (cosine * cosine).max(1e-6)
}

/// The reflectance is divided by the cosine of the angle that was read, and taken to stand at that angle, from which it
/// changes by these slopes for the light and the sensor arm.
fn arms(slopes: [DVec3; 2], f: DVec3, m: &Measurement, rig: &RigFile) -> [DVec3; 2] {
    let [light, sensor] = [m.pose.light.rad(), m.pose.sensor.rad()];
    let mut arms = slopes;
    match rig.calibration.filling {
        Filling::Over => arms[Arm::Light as usize] -= f * light.tan(),
        Filling::Under => arms[Arm::Sensor as usize] -= f * sensor.tan(),
    }
    arms
}

/// How unsure the zeros of both arms are in a run, by its certificate and the rig file.
pub(crate) fn zeros(records: &[capture::Record], rig: &RigFile) -> ZeroUncertainty {
    certificate(records).map_or_else(
        || ZeroUncertainty::of_each_arm(rig.uncertainty.zero_rad),
        |certificate| certificate.u_zero(rig),
    )
}

/// Gives every measurement its expanded uncertainty, k = 2: counting noise, dark, lamp drift, reference, linearity, gains,
/// colour mixing, stray light, angles (slope of the lobe, tan θ) and apertures, as independent of each other. The zeros of
/// the arms are not: of both, half the sum and half the difference are.
pub(crate) fn expand(measurements: &mut [Measurement], records: &[capture::Record], rig: &RigFile) {
    let zeros = zeros(records, rig);
    let angle_rad = rig.uncertainty.angle_rad;
    let sensitivities = sensitivities(measurements, rig);
    for (m, sensitivity) in measurements.iter_mut().zip(sensitivities) {
        let Some(budget) = m.budget else { continue };
        let square = |u: [f64; 3]| {
            let u = DVec3::from_array(u);
            u * u
        };
        let [light, sensor] = sensitivity.arms;
        let of_zeros = [0, 1, 2].map(|c| zeros.variance([light[c], sensor[c]]));
        let sum = square(budget.counting)
            + square(budget.dark)
            + square(budget.drift)
            + square(budget.reference)
            + square(budget.linearity)
            + square(budget.all_gains())
            + square(budget.colour)
            + square(budget.stray)
            + angle_rad * angle_rad * (light * light + sensor * sensor)
            + DVec3::from_array(of_zeros)
            + sensitivity.aperture * sensitivity.aperture;
        m.u = Some(COVERAGE * DVec3::from_array(sum.to_array().map(f64::sqrt)));
        m.sensitivity = sensitivity;
    }
}
