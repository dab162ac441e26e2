use arms::Arm;
use glam::DVec3;
use rig::{RigFile, ZeroUncertainty};

use crate::Measurement;
use crate::measurement::certificate;
use crate::sensitivity::sensitivities;

/// Coverage factor of what is reported: 95 % of a normal distribution.
pub const COVERAGE: f64 = 2.0;

/// How unsure the zeros of both arms are in a run, by its certificate and the rig file.
pub(crate) fn zeros(records: &[capture::Record], rig: &RigFile) -> ZeroUncertainty {
    certificate(records).map_or_else(
        || ZeroUncertainty::of_each_arm(rig.uncertainty.zero_rad),
        |certificate| certificate.u_zero(rig),
    )
}

/// Standard uncertainty of each arm's angle in one reading, rad: what the rig file says of any, and how much the arm was seen to
/// move about where it is taken to have been.
pub(crate) fn angle_rad(m: &Measurement, rig: &RigFile) -> [f64; 2] {
    let spread_rad = m.reading.spread_rad.unwrap_or_default();
    Arm::BOTH.map(|arm| {
        let spread_rad = spread_rad[arm as usize];
        let moved_rad = match m.reading.swept_rad {
            // Twice the standard deviation.
            Some(_) => spread_rad / 2.0,
            // From end to end, and anywhere between; one count of it is what rounding may make.
            None => {
                let count_rad = rig.arm(arm).axis.resolution_rad();
                ((spread_rad * spread_rad - count_rad * count_rad).max(0.0) / 12.0).sqrt()
            }
        };
        rig.uncertainty.angle_rad[arm as usize].hypot(moved_rad)
    })
}

/// Gives every measurement its expanded uncertainty, k = 2: counting noise, dark, lamp drift, reference, linearity, gains,
/// colour mixing, stray light, angles (slope of the lobe, tan θ) and apertures, as independent of each other. The zeros of
/// the arms are not: of both, half the sum, which is the alignment's turn, and half the difference are.
pub(crate) fn expand(measurements: &mut [Measurement], zeros: ZeroUncertainty, rig: &RigFile) {
    let sensitivities = sensitivities(measurements, rig);
    for (m, sensitivity) in measurements.iter_mut().zip(sensitivities) {
        let Some(budget) = m.budget else { continue };
        let square = |u: [f64; 3]| {
            let u = DVec3::from_array(u);
            u * u
        };
        let [light, sensor] = sensitivity.arms;
        let apart = ZeroUncertainty {
            half_sum_rad: 0.0,
            ..zeros
        };
        let of_zeros = [0, 1, 2].map(|c| {
            let arms = [light[c], sensor[c]];
            apart.variance(arms) + m.alignment.variance(arms, m.reading.sweep, m.lean)
        });
        let [u_light, u_sensor] = angle_rad(m, rig);
        let sum = square(budget.counting)
            + square(budget.dark)
            + square(budget.drift)
            + square(budget.reference)
            + square(budget.linearity)
            + square(budget.all_gains())
            + square(budget.colour)
            + square(budget.stray)
            + light * light * (u_light * u_light)
            + sensor * sensor * (u_sensor * u_sensor)
            + DVec3::from_array(of_zeros)
            + sensitivity.bend * sensitivity.bend
            + sensitivity.aperture * sensitivity.aperture;
        m.u = Some(COVERAGE * DVec3::from_array(sum.to_array().map(f64::sqrt)));
        m.sensitivity = sensitivity;
    }
}
