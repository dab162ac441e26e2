use arms::{ArmAngle, Pose};
use rig::{Approach, Lamp, Port, RigFile};
use sweep::Mechanics;

use crate::execution::MAX_EXPOSURES;
use crate::exposure::brief;

/// What a planner needs to know of the rig in a rig file, with the arms standing at `start`.
pub fn mechanics(rig: &RigFile, start: Option<Pose>) -> Mechanics {
    Mechanics {
        envelope: rig.envelope,
        margin_rad: rig.uncertainty.shadow_margin_rad(),
        tolerance_rad: rig.motion.near_rad,
        profiles: rig.arms.each_ref().map(|arm| arm.profile),
        resolution_rad: rig.arms.each_ref().map(|arm| arm.axis.resolution_rad()),
        grid_rad: rig
            .arms
            .each_ref()
            .map(|arm| arm.axis.nearest(ArmAngle::NORMAL).rad()),
        approach: match rig.motion.approach {
            Approach::None => 0,
            Approach::Up => 1,
            Approach::Down => -1,
        },
        overshoot_rad: rig.motion.overshoot_rad,
        settle_s: rig.motion.settle.as_secs_f64(),
        late_s: rig.motion.late.as_secs_f64(),
        integration_us: [
            rig.photometer.integration_min_us,
            rig.photometer.integration_max_us,
        ],
        // And one for the faintest channel.
        exposures: MAX_EXPOSURES + 1,
        transaction_s: transaction_s(rig),
        in_flight: rig.detector.abilities().in_flight,
        flight_s: flight_s(rig),
        warm_up_s: rig.photometer.lamp_warm_up.as_secs_f64(),
        dark_every_s: rig.visits.dark_every.as_secs_f64(),
        reference: match rig.visits.lamp {
            Lamp::Monitor => None,
            Lamp::Visits => Some((
                rig.nearest(rig.visits.reference),
                rig.visits.reference_every.as_secs_f64(),
            )),
        },
        start: start.map(|pose| rig.admitted(pose)),
    }
}

/// Expected time of a reading in flight: the light that a grey specimen gives, and of the transactions of a reading at rest
/// an observation and a trigger.
fn flight_s(rig: &RigFile) -> f64 {
    /// Reflectance times cosine of something neither bright nor dark, sr⁻¹.
    const GREY_PER_SR: f64 = 0.1;
    const SHARE: f64 = 0.4;
    let rate = GREY_PER_SR * rig.calibration.responsivity.into_iter().fold(0.0, f64::max);
    let light_s = brief(rig, rate, f64::INFINITY).duration().as_secs_f64();
    light_s + SHARE * transaction_s(rig)
}

/// Expected time on the bus for one reading.
///
/// About six snapshots (before, at and after a motion), the start, status, trigger and counts. A real adapter also
/// holds each answer back for up to its latency, half of that on the average.
fn transaction_s(rig: &RigFile) -> f64 {
    /// Measured on the simulated wire.
    const BYTES: f64 = 630.0;
    const ANSWERS: f64 = 10.0;
    const BITS_PER_BYTE: f64 = 10.0;
    let wire_s = BYTES * BITS_PER_BYTE / f64::from(rig.bus.baud);
    match rig.bus.port {
        Port::Sim => wire_s,
        Port::Path(_) => wire_s + ANSWERS * rig.bus.latency.as_secs_f64() / 2.0,
    }
}
