//! `[calibration]` and `[uncertainty]`.

use std::path::PathBuf;
use std::time::Duration;

use arms::{ArmAngle, Envelope, Pose};
use toml::Spanned;

use crate::file::raw::{RawCalibration, RawUncertainty};
use crate::file::source::{Source, number};
use crate::file::{ArmSettings, Certificates, Uncertainties, Visits};
use crate::{Calibration, Filling, Lamp, RigError};

/// Minutes in a day.
const DAY_MIN: f64 = 1440.0;
/// Hours in ten years.
const DECADE_H: f64 = 87_600.0;

pub(super) fn constants(source: &Source<'_>, raw: &RawCalibration) -> Result<Calibration, RigError> {
    let fillings = [("over", Filling::Over), ("under", Filling::Under)];
    let filling = source.one_of("calibration.filling", &raw.filling, &fillings)?;
    let positive = |value: f64| value > 0.0 && value.is_finite();
    let responsivity = *raw.responsivity.get_ref();
    if !responsivity.into_iter().all(positive) {
        let found = format!("{responsivity:?}");
        return Err(source.refuse(
            "calibration.responsivity",
            &raw.responsivity,
            found,
            "three finite values > 0",
        ));
    }
    let monitor = *raw.monitor.get_ref();
    if !positive(monitor) {
        return Err(source.refuse("calibration.monitor", &raw.monitor, monitor, "a finite value > 0"));
    }
    Ok(Calibration {
        filling,
        responsivity,
        monitor,
    })
}

pub(super) fn visits(
    source: &Source<'_>,
    raw: &RawCalibration,
    envelope: &Envelope,
    margin_rad: f64,
) -> Result<Visits, RigError> {
    let minutes = |key: &str, value: &Spanned<f64>, least: f64| {
        let minutes = source.within(&format!("calibration.{key}"), value, least..=DAY_MIN)?;
        Ok(Duration::from_secs_f64(minutes * 60.0))
    };
    let degrees = |key: &str, value: &Spanned<f64>| {
        source
            .within(&format!("calibration.{key}"), value, -90.0..=90.0)
            .map(ArmAngle::from_deg)
    };
    let lamps = [("monitor", Lamp::Monitor), ("visits", Lamp::Visits)];
    let visits = Visits {
        dark_every: minutes("dark_every_min", &raw.dark_every_min, 0.0)?,
        lamp: source.one_of("calibration.lamp", &raw.lamp, &lamps)?,
        reference_every: minutes("reference_every_min", &raw.reference_every_min, 0.1)?,
        reference: Pose {
            light: degrees("reference_light_deg", &raw.reference_light_deg)?,
            sensor: degrees("reference_sensor_deg", &raw.reference_sensor_deg)?,
        },
    };
    let clear = envelope.clearance_rad(visits.reference, [0.0; 2]) >= margin_rad;
    let reachable = envelope.check_pose(visits.reference).is_ok() && clear;
    if visits.lamp == Lamp::Visits && !reachable {
        return Err(source.refuse(
            "calibration.reference_light_deg",
            &raw.reference_light_deg,
            visits.reference.light.deg(),
            "a pose within [envelope] at which the arms do not shadow each other",
        ));
    }
    Ok(visits)
}

pub(super) fn certificates(source: &Source<'_>, raw: &RawCalibration) -> Result<Certificates, RigError> {
    let max_age_h = source.within("calibration.max_age_h", &raw.max_age_h, 0.1..=DECADE_H)?;
    if raw.directory.get_ref().is_empty() {
        return Err(source.refuse("calibration.directory", &raw.directory, "empty", "a directory"));
    }
    let words = [("none", false), ("required", true)];
    Ok(Certificates {
        required: source.one_of("calibration.certificate", &raw.certificate, &words)?,
        directory: PathBuf::from(raw.directory.get_ref()),
        max_age: Duration::from_secs_f64(max_age_h * 3600.0),
    })
}

/// Standard deviation of what is rounded to whole counts, counts.
const ROUNDED: f64 = 0.288_675_134_594_812_9;

pub(super) fn uncertainty(
    source: &Source<'_>,
    raw: &RawUncertainty,
    arms: [&ArmSettings; 2],
) -> Result<Uncertainties, RigError> {
    let within = |key: &str, value: &Spanned<f64>, max: f64| {
        source.within(&format!("uncertainty.{key}"), value, 0.0..=max)
    };
    let radians = |key: &str, value: &Spanned<f64>| within(key, value, 10.0).map(f64::to_radians);
    let percent =
        |key: &str, value: &Spanned<f64>, max: f64| within(key, value, max).map(|value| value / 100.0);
    Ok(Uncertainties {
        electrons_per_count: within("electrons_per_count", &raw.electrons_per_count, 1e6)?,
        read_noise_counts: within("read_noise_counts", &raw.read_noise_counts, 1e4)?,
        responsivity: percent("responsivity_percent", &raw.responsivity_percent, 100.0)?,
        gain: percent("gain_percent", &raw.gain_percent, 100.0)?,
        nonlinearity: percent("nonlinearity_percent", &raw.nonlinearity_percent, 20.0)?,
        crosstalk: percent("crosstalk_percent", &raw.crosstalk_percent, 50.0)?,
        stray_per_sr: within("stray_per_sr", &raw.stray_per_sr, 1.0)?,
        angle_rad: of_arms(source, "angle_deg", &raw.angle_deg, 10.0, arms, |arm| {
            ROUNDED * arm.axis.resolution_rad().to_degrees()
        })?,
        play_rad: of_arms(source, "play_deg", &raw.play_deg, 5.0, arms, |arm| {
            arm.model.series.backlash_deg / arm.axis.gear
        })?,
        encoder_rad: radians("encoder_deg", &raw.encoder_deg)?,
        tilt_rad: radians("tilt_deg", &raw.tilt_deg)?,
        zero_rad: radians("zero_deg", &raw.zero_deg)?,
        apertures_rad: [
            radians("source_aperture_deg", &raw.source_aperture_deg)?,
            radians("detector_aperture_deg", &raw.detector_aperture_deg)?,
        ],
    })
}

/// An angle of each arm, rad: by its servo, or one for both in degrees.
fn of_arms(
    source: &Source<'_>,
    key: &str,
    value: &Spanned<toml::Value>,
    max_deg: f64,
    arms: [&ArmSettings; 2],
    of_servo_deg: impl Fn(&ArmSettings) -> f64,
) -> Result<[f64; 2], RigError> {
    let key = format!("uncertainty.{key}");
    if value.get_ref().as_str() == Some("model") {
        return Ok(arms.map(|arm| of_servo_deg(arm).to_radians()));
    }
    match number(value.get_ref()) {
        Some(deg) => {
            let deg = source.within(&key, &Spanned::new(value.span(), deg), 0.0..=max_deg)?;
            Ok([deg.to_radians(); 2])
        }
        None => {
            let allowed = format!("\"model\", or degrees for both arms, 0 … {max_deg}");
            Err(source.refuse(&key, value, value.get_ref(), allowed))
        }
    }
}
