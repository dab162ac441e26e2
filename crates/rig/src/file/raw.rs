use serde::Deserialize;
use toml::Spanned;

/// The rig file as TOML spells it; every key present, since the built-in file stands beneath.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFile {
    pub(super) rig: RawAbout,
    pub(super) bus: RawBus,
    pub(super) light: RawArm,
    pub(super) sensor: RawArm,
    pub(super) envelope: RawEnvelope,
    pub(super) motion: RawMotion,
    pub(super) detector: RawDetector,
    pub(super) photometer: RawPhotometer,
    pub(super) calibration: RawCalibration,
    pub(super) suspend: RawSuspend,
    pub(super) uncertainty: RawUncertainty,
    pub(super) sim: toml::Table,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawAbout {
    pub(super) name: Spanned<String>,
    pub(super) id: Spanned<String>,
    pub(super) location: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawBus {
    pub(super) port: Spanned<String>,
    pub(super) baud: Spanned<i64>,
    pub(super) latency_ms: Spanned<f64>,
    pub(super) echo: bool,
    pub(super) silence_ms: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawDetector {
    pub(super) kind: Spanned<String>,
    pub(super) address: Spanned<String>,
    pub(super) baud: Spanned<i64>,
    pub(super) profile: Spanned<String>,
    pub(super) full_reading: Spanned<f64>,
    pub(super) line_hz: Spanned<f64>,
    pub(super) timeout_ms: Spanned<f64>,
    pub(super) settle_ms: Spanned<f64>,
    pub(super) lamp: Spanned<String>,
    pub(super) setup: Spanned<String>,
    pub(super) configure: Spanned<String>,
    pub(super) read: Spanned<String>,
    pub(super) lamp_on: Spanned<String>,
    pub(super) lamp_off: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawArm {
    pub(super) id: Spanned<i64>,
    pub(super) model: Spanned<String>,
    pub(super) sign: Spanned<i64>,
    pub(super) zero_deg: Spanned<f64>,
    pub(super) gear: Spanned<f64>,
    pub(super) min_deg: Spanned<f64>,
    pub(super) max_deg: Spanned<f64>,
    pub(super) velocity_deg_s: Spanned<f64>,
    pub(super) acceleration_deg_s2: Spanned<f64>,
    pub(super) return_delay_us: Spanned<i64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawEnvelope {
    pub(super) separation_deg: Spanned<f64>,
    pub(super) can_pass: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMotion {
    pub(super) near_deg: Spanned<f64>,
    pub(super) still_deg: Spanned<f64>,
    pub(super) settle_ms: Spanned<f64>,
    pub(super) late_ms: Spanned<f64>,
    pub(super) timeout_ms: Spanned<f64>,
    pub(super) approach: Spanned<String>,
    pub(super) overshoot_deg: Spanned<f64>,
    pub(super) watchdog_ms: Spanned<i64>,
    pub(super) estop: Spanned<String>,
    pub(super) park_between: bool,
    pub(super) park_light_deg: Spanned<f64>,
    pub(super) park_sensor_deg: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPhotometer {
    pub(super) id: Spanned<i64>,
    pub(super) integration_min_us: Spanned<i64>,
    pub(super) integration_max_us: Spanned<i64>,
    pub(super) full_scale: Spanned<i64>,
    pub(super) aim: Spanned<f64>,
    pub(super) enough: Spanned<i64>,
    pub(super) flight_noise_percent: Spanned<f64>,
    pub(super) lamp_warm_up_ms: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCalibration {
    pub(super) filling: Spanned<String>,
    pub(super) responsivity: Spanned<[f64; 3]>,
    pub(super) monitor: Spanned<f64>,
    pub(super) lamp: Spanned<String>,
    pub(super) dark_every_min: Spanned<f64>,
    pub(super) reference_every_min: Spanned<f64>,
    pub(super) reference_light_deg: Spanned<f64>,
    pub(super) reference_sensor_deg: Spanned<f64>,
    pub(super) certificate: Spanned<String>,
    pub(super) directory: Spanned<String>,
    pub(super) max_age_h: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSuspend {
    pub(super) every_s: Spanned<f64>,
    pub(super) temperature_c: Spanned<[f64; 2]>,
    pub(super) supply_v: Spanned<toml::Value>,
    pub(super) lamp_percent: Spanned<[f64; 2]>,
    pub(super) disk_mb: Spanned<[f64; 2]>,
    pub(super) door: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawUncertainty {
    pub(super) electrons_per_count: Spanned<f64>,
    pub(super) read_noise_counts: Spanned<f64>,
    pub(super) responsivity_percent: Spanned<f64>,
    pub(super) gain_percent: Spanned<f64>,
    pub(super) nonlinearity_percent: Spanned<f64>,
    pub(super) crosstalk_percent: Spanned<f64>,
    pub(super) stray_per_sr: Spanned<f64>,
    pub(super) angle_deg: Spanned<toml::Value>,
    pub(super) play_deg: Spanned<toml::Value>,
    pub(super) encoder_deg: Spanned<f64>,
    pub(super) tilt_deg: Spanned<f64>,
    pub(super) zero_deg: Spanned<f64>,
    pub(super) source_aperture_deg: Spanned<f64>,
    pub(super) detector_aperture_deg: Spanned<f64>,
}
