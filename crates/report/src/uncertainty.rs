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
