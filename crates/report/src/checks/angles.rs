use arms::Arm;
use serde_json::json;
use sweep::Sweep;

use crate::alignment::{Alignment, Told};
use crate::uncertainty::COVERAGE;
use crate::{Check, Measurement, Verdict};

/// Turns of more than so many of what they may be beforehand, and of more than so much, rad: the specimen lies askew, or an arm
/// has slipped on its servo.
const TURNED: f64 = 2.0;
const TURNED_LEAST_RAD: f64 = 0.0044;
/// Lobes that stand farther than this from where all of them together say, by their own expanded uncertainties and in rad,
/// disagree.
const DISAGREE: f64 = 2.0;
const DISAGREE_LEAST_RAD: f64 = 0.0009;

/// What the run's own lobes say of its angles: by how much all are turned, by how much each arm lags behind its encoder, and
/// whether the sweeps agree with each other.
pub(crate) fn angles(measurements: &[Measurement]) -> Option<Check> {
    let alignment = measurements.first()?.alignment.as_ref();
    let [turn, u_turn] = expanded(alignment.turn_rad());
    let [light, sensor] = Arm::BOTH.map(|arm| expanded(alignment.lag_rad(arm)));
    let worst = alignment.told.iter().max_by(|a, b| off(a).total_cmp(&off(b)));
    let (verdict, text) = match worst {
        None if alignment.lobe.is_some() => (
            Verdict::Unknown,
            "The lobe of this specimen is narrow, but none of the sweeps tells where it stands: it was read too coarsely, or the arms \
             came to the poses from both sides. The encoders are taken to err by several times what [uncertainty] encoder_deg \
             says. Read its planes more densely, or from one side ([motion] approach)."
                .to_owned(),
        ),
        None => (
            Verdict::Unknown,
            "No lobe of this specimen is narrow enough, and read on both sides, to tell where the mirror direction is: the \
             angles are as the encoders and the certificate say, and as sure as [uncertainty] in the rig file says."
                .to_owned(),
        ),
        Some(worst) if off(worst) > 1.0 => (
            Verdict::Look,
            format!(
                "The lobe of {} stands {:+.2}° from where those of all sweeps together put it: an encoder errs more than \
                 [uncertainty] encoder_deg says, or an arm moved on its servo. The angles' uncertainties were widened.",
                named(worst.sweep),
                worst.left_rad.to_degrees()
            ),
        ),
        Some(_) if turn.abs() > TURNED * u_before(alignment).max(TURNED_LEAST_RAD / TURNED).to_degrees() => (
            Verdict::Look,
            format!(
                "All angles are turned by {turn:+.2}° ± {u_turn:.2}°, and were corrected by that: the specimen lies askew on the \
                 stage, or the zeros of the arms are off. See that it lies flat, or measure a mirror (gonioctl calibrate)."
            ),
        ),
        Some(_) => (
            Verdict::Good,
            format!(
                "By the lobes of {} passes all angles are turned by {turn:+.2}° ± {u_turn:.2}°, and were corrected by that; \
                 behind its encoder the light arm lags by {:.2}° ± {:.2}°, the sensor arm by {:.2}° ± {:.2}°.",
                alignment.told.len(),
                light[0],
                light[1],
                sensor[0],
                sensor[1]
            ),
        ),
    };
    let lobe = |told: &Told| {
        json!({
            "sweep": told.sweep.to_string(),
            "light_moved": told.lean[0],
            "sensor_moved": told.lean[1],
            "centre_deg": told.centre.half_rad.to_degrees(),
            "u_deg": COVERAGE * told.centre.u_rad.to_degrees(),
            "left_deg": told.left_rad.to_degrees(),
        })
    };
    Some(Check {
        name: "angles",
        verdict,
        text,
        values: json!({
            "turn_deg": turn,
            "u_turn_deg": u_turn,
            "light_lag_deg": light[0],
            "u_light_lag_deg": light[1],
            "sensor_lag_deg": sensor[0],
            "u_sensor_lag_deg": sensor[1],
            "lobes": alignment.told.iter().map(lobe).collect::<Vec<_>>(),
        }),
    })
}

/// Estimate and expanded uncertainty in degrees, of an estimate with a standard uncertainty in rad.
fn expanded([estimate, u]: [f64; 2]) -> [f64; 2] {
    [estimate.to_degrees(), COVERAGE * u.to_degrees()]
}

/// How much of what a lobe may be off it is.
fn off(told: &Told) -> f64 {
    told.left_rad.abs() / (DISAGREE * COVERAGE * told.centre.u_rad).max(DISAGREE_LEAST_RAD)
}

/// Expanded uncertainty of the turn before any lobe told it, rad.
fn u_before(alignment: &Alignment) -> f64 {
    COVERAGE * alignment.u_turn_before_rad
}

fn named(sweep: Sweep) -> String {
    match sweep {
        Sweep::Plane(index) => format!("plane {}", index + 1),
        Sweep::Leg(index) => format!("leg {}", index + 1),
        other => other.to_string(),
    }
}
