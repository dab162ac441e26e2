use std::path::PathBuf;
use std::time::Duration;

use arms::{Arm, ArmAngle, Envelope, Limits, Pose, Profile};
use toml::Spanned;

use super::detector::detector;
use super::raw::{RawAbout, RawArm, RawBus, RawMotion, RawPhotometer};
use super::source::Source;
use super::{
    About, Approach, ArmSettings, BusSettings, Estop, MotionSettings, PhotometerSettings, Port, RigFile,
    Visits,
};
use crate::dynamixel::{BAUD_RATES, MODELS, Model};
use crate::{Axis, Calibration, Lamp, RigError};

mod calibration;
mod suspend;

/// The text checked: each key for itself, then what keys say together.
pub(super) fn file(source: &Source<'_>) -> Result<RigFile, RigError> {
    let raw = source.raw(RigFile::BUILT_IN)?;
    let light = arm(source, "light", &raw.light)?;
    let sensor = arm(source, "sensor", &raw.sensor)?;
    let bus = bus(source, &raw.bus, [light.model, sensor.model])?;
    let separation = source.within(
        "envelope.separation_deg",
        &raw.envelope.separation_deg,
        0.0..=60.0,
    )?;
    let envelope = Envelope {
        light: limits(source, "light", &raw.light, &light)?,
        sensor: limits(source, "sensor", &raw.sensor, &sensor)?,
        separation_rad: separation.to_radians(),
        can_pass: raw.envelope.can_pass,
    };
    let photometer = photometer(source, &raw.photometer)?;
    let calibration = calibration::constants(source, &raw.calibration)?;
    let uncertainty = calibration::uncertainty(source, &raw.uncertainty, [&light, &sensor])?;
    let margin_rad = uncertainty.shadow_margin_rad();
    let visits = calibration::visits(source, &raw.calibration, &envelope, margin_rad)?;
    monitored(source, &raw.photometer, &photometer, &calibration, &visits)?;
    let detector = detector(
        source,
        &raw.detector,
        (&raw.photometer, &photometer),
        &visits,
        &bus.port,
    )?;
    for (key, id, others) in [
        ("sensor.id", &raw.sensor.id, vec![light.id]),
        ("photometer.id", &raw.photometer.id, vec![light.id, sensor.id]),
    ] {
        if others.iter().any(|&other| i64::from(other) == *id.get_ref()) {
            return Err(source.refuse(key, id, id.get_ref(), "an id that no other device of the rig has"));
        }
    }
    Ok(RigFile {
        about: about(source, &raw.rig)?,
        bus,
        suspend: suspend::suspend(source, &raw.suspend, [light.model, sensor.model])?,
        arms: [light, sensor],
        motion: motion(source, &raw.motion, &envelope)?,
        detector,
        photometer,
        calibration,
        visits,
        certificates: calibration::certificates(source, &raw.calibration)?,
        uncertainty,
        fingerprint: source.fingerprint(RigFile::BUILT_IN)?,
        envelope,
        sim: raw.sim,
    })
}

/// What the rig is called.
fn about(source: &Source<'_>, raw: &RawAbout) -> Result<About, RigError> {
    let line = |key: &str, value: &Spanned<String>| source.line(key, value, value.get_ref().trim());
    Ok(About {
        name: line("rig.name", &raw.name)?,
        id: line("rig.id", &raw.id)?,
        location: line("rig.location", &raw.location)?,
    })
}

/// A duration in ms.
pub(super) fn millis(
    source: &Source<'_>,
    key: &str,
    value: &Spanned<f64>,
    range: std::ops::RangeInclusive<f64>,
) -> Result<Duration, RigError> {
    source
        .within(key, value, range)
        .map(|ms| Duration::from_secs_f64(ms / 1000.0))
}

fn id(source: &Source<'_>, key: &str, value: &Spanned<i64>) -> Result<u8, RigError> {
    source.within(key, value, 0..=252).map(|id| id as u8)
}

fn bus(source: &Source<'_>, raw: &RawBus, models: [&Model; 2]) -> Result<BusSettings, RigError> {
    let port = match raw.port.get_ref().as_str() {
        "sim" => Port::Sim,
        "" => return Err(source.refuse("bus.port", &raw.port, "empty", "\"sim\" or a serial port")),
        path => Port::Path(PathBuf::from(path)),
    };
    let Some(&(code, baud)) = BAUD_RATES
        .iter()
        .find(|(_, baud)| i64::from(*baud) == *raw.baud.get_ref())
    else {
        let rates: Vec<_> = BAUD_RATES.iter().map(|(_, baud)| baud.to_string()).collect();
        return Err(source.refuse("bus.baud", &raw.baud, raw.baud.get_ref(), rates.join(", ")));
    };
    if let Some(model) = models.iter().find(|model| code > model.series.baud_code_max) {
        let rates = BAUD_RATES
            .iter()
            .filter(|(code, _)| *code <= model.series.baud_code_max);
        let rates: Vec<_> = rates.map(|(_, baud)| baud.to_string()).collect();
        let allowed = format!("{} with an {}", rates.join(", "), model.name);
        return Err(source.refuse("bus.baud", &raw.baud, baud, allowed));
    }
    Ok(BusSettings {
        port,
        baud,
        latency: millis(source, "bus.latency_ms", &raw.latency_ms, 0.0..=100.0)?,
        echo: raw.echo,
        silence: millis(source, "bus.silence_ms", &raw.silence_ms, 50.0..=5000.0)?,
    })
}

fn arm(source: &Source<'_>, table: &str, raw: &RawArm) -> Result<ArmSettings, RigError> {
    let key = |key: &str| format!("{table}.{key}");
    let model = Model::named(raw.model.get_ref()).ok_or_else(|| {
        let allowed: Vec<_> = MODELS.iter().map(|model| format!("\"{}\"", model.name)).collect();
        let found = format!("\"{}\"", raw.model.get_ref());
        source.refuse(&key("model"), &raw.model, found, allowed.join(", "))
    })?;
    if ![1, -1].contains(raw.sign.get_ref()) {
        return Err(source.refuse(&key("sign"), &raw.sign, raw.sign.get_ref(), "1, -1"));
    }
    let gear = source.within(&key("gear"), &raw.gear, 0.1..=20.0)?;
    let units = model.units();
    let zeros = match model.series.centred {
        true => -180.0..=180.0,
        false => 0.0..=360.0,
    };
    let axis = Axis {
        sign: if *raw.sign.get_ref() > 0 { 1.0 } else { -1.0 },
        zero_count: source.within(&key("zero_deg"), &raw.zero_deg, zeros)? / 360.0 * units.counts_per_turn,
        gear,
        units,
    };
    let unit = (units.velocity_rad_s / gear).to_degrees();
    let velocity = register_range(unit, units.velocity_max);
    let velocity = source.within(&key("velocity_deg_s"), &raw.velocity_deg_s, velocity)?;
    let unit = (units.acceleration_rad_s2 / gear).to_degrees();
    let acceleration = register_range(unit, units.acceleration_max);
    let acceleration = source.within(
        &key("acceleration_deg_s2"),
        &raw.acceleration_deg_s2,
        acceleration,
    )?;
    let delay = source.within(&key("return_delay_us"), &raw.return_delay_us, 0..=508)?;
    if delay % 2 != 0 {
        return Err(source.refuse(
            &key("return_delay_us"),
            &raw.return_delay_us,
            delay,
            "0 … 508 in steps of 2",
        ));
    }
    Ok(ArmSettings {
        id: id(source, &key("id"), &raw.id)?,
        model,
        axis,
        profile: axis.quantised(Profile {
            velocity_rad_s: velocity.to_radians(),
            acceleration_rad_s2: acceleration.to_radians(),
        }),
        return_delay: Duration::from_micros(delay as u64),
    })
}

/// From one unit to the register's largest value, rounded inwards to three digits so that what an error prints is
/// allowed; the last bit of a product of units is not what decides.
fn register_range(unit: f64, max: u32) -> std::ops::RangeInclusive<f64> {
    (unit * 1000.0 - 1e-6).ceil() / 1000.0..=(unit * f64::from(max) * 1000.0 + 1e-6).floor() / 1000.0
}

/// Limits of an arm, which must also lie within the single turn of the servo's position mode.
fn limits(source: &Source<'_>, table: &str, raw: &RawArm, arm: &ArmSettings) -> Result<Limits, RigError> {
    let (first, last) = arm.model.positions().into_inner();
    let turn = f64::from(first)..=f64::from(last);
    for (key, value) in [("min_deg", &raw.min_deg), ("max_deg", &raw.max_deg)] {
        let key = format!("{table}.{key}");
        let deg = source.within(&key, value, -90.0..=90.0)?;
        let count = arm.axis.counts(ArmAngle::from_deg(deg)).round();
        if !turn.contains(&count) {
            let found = format!("{deg}, which is servo count {count}");
            let allowed = format!("servo counts {first} … {last} after zero_deg, sign and gear");
            return Err(source.refuse(&key, value, found, allowed));
        }
    }
    let limits = Limits {
        min: ArmAngle::from_deg(*raw.min_deg.get_ref()),
        max: ArmAngle::from_deg(*raw.max_deg.get_ref()),
    };
    if limits.min >= limits.max {
        let allowed = format!("above {table}.min_deg, which is {}", raw.min_deg.get_ref());
        return Err(source.refuse(
            &format!("{table}.max_deg"),
            &raw.max_deg,
            raw.max_deg.get_ref(),
            allowed,
        ));
    }
    Ok(limits)
}

fn motion(source: &Source<'_>, raw: &RawMotion, envelope: &Envelope) -> Result<MotionSettings, RigError> {
    let angle = |key: &str, value: &Spanned<f64>, arm: Arm| {
        let limits = envelope.limits(arm);
        let range = limits.min.deg()..=limits.max.deg();
        source
            .within(&format!("motion.{key}"), value, range)
            .map(|_| ArmAngle::from_deg(*value.get_ref()))
    };
    let park = Pose {
        light: angle("park_light_deg", &raw.park_light_deg, Arm::Light)?,
        sensor: angle("park_sensor_deg", &raw.park_sensor_deg, Arm::Sensor)?,
    };
    envelope.check_pose(park).map_err(|violation| {
        let found = format!("{}: {violation}", raw.park_sensor_deg.get_ref());
        source.refuse(
            "motion.park_sensor_deg",
            &raw.park_sensor_deg,
            found,
            "a pose within [envelope]",
        )
    })?;
    let watchdog = source.within("motion.watchdog_ms", &raw.watchdog_ms, 0..=2540)?;
    if watchdog % 20 != 0 {
        return Err(source.refuse(
            "motion.watchdog_ms",
            &raw.watchdog_ms,
            watchdog,
            "0, or 20 … 2540 in steps of 20",
        ));
    }
    let approaches = [
        ("none", Approach::None),
        ("up", Approach::Up),
        ("down", Approach::Down),
    ];
    let estops = [("hold", Estop::Hold), ("limp", Estop::Limp)];
    let near = source.within("motion.near_deg", &raw.near_deg, 0.05..=5.0)?;
    let still = source.within("motion.still_deg", &raw.still_deg, 0.02..=5.0)?;
    let overshoot = source.within("motion.overshoot_deg", &raw.overshoot_deg, 0.0..=10.0)?;
    Ok(MotionSettings {
        near_rad: near.to_radians(),
        still_rad: still.to_radians(),
        settle: millis(source, "motion.settle_ms", &raw.settle_ms, 0.0..=5000.0)?,
        late: millis(source, "motion.late_ms", &raw.late_ms, 0.0..=1000.0)?,
        timeout: millis(source, "motion.timeout_ms", &raw.timeout_ms, 50.0..=10000.0)?,
        approach: source.one_of("motion.approach", &raw.approach, &approaches)?,
        overshoot_rad: overshoot.to_radians(),
        watchdog: Duration::from_millis(watchdog as u64),
        estop: source.one_of("motion.estop", &raw.estop, &estops)?,
        park,
        park_between: raw.park_between,
    })
}

fn photometer(source: &Source<'_>, raw: &RawPhotometer) -> Result<PhotometerSettings, RigError> {
    let min = source.within(
        "photometer.integration_min_us",
        &raw.integration_min_us,
        10..=10_000_000,
    )?;
    let max = source.within(
        "photometer.integration_max_us",
        &raw.integration_max_us,
        min..=10_000_000,
    )?;
    let full_scale = source.within("photometer.full_scale", &raw.full_scale, 1..=16_777_215)?;
    let enough = source.within("photometer.enough", &raw.enough, 0..=full_scale)?;
    Ok(PhotometerSettings {
        id: id(source, "photometer.id", &raw.id)?,
        integration_min_us: min as u32,
        integration_max_us: max as u32,
        full_scale: full_scale as u32,
        aim: source.within("photometer.aim", &raw.aim, 0.05..=0.9)?,
        enough: enough as u32,
        flight_noise_rel: source.within(
            "photometer.flight_noise_percent",
            &raw.flight_noise_percent,
            0.05..=10.0,
        )? / 100.0,
        lamp_warm_up: millis(
            source,
            "photometer.lamp_warm_up_ms",
            &raw.lamp_warm_up_ms,
            0.0..=600_000.0,
        )?,
    })
}

/// The longest integration leaves room on the lamp monitor, where nothing else follows the lamp.
fn monitored(
    source: &Source<'_>,
    raw: &RawPhotometer,
    photometer: &PhotometerSettings,
    calibration: &Calibration,
    visits: &Visits,
) -> Result<(), RigError> {
    let full_us = f64::from(photometer.full_scale) / calibration.monitor;
    if visits.lamp != Lamp::Monitor || f64::from(photometer.integration_max_us) < full_us {
        return Ok(());
    }
    Err(source.refuse(
        "photometer.integration_max_us",
        &raw.integration_max_us,
        photometer.integration_max_us,
        format!("below {full_us:.0}, where the lamp monitor is full (calibration.monitor)"),
    ))
}
