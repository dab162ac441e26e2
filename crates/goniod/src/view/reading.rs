use report::Measurement;
use serde::Serialize;
use utoipa::ToSchema;

/// A reading with what follows from it.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct ReadingView {
    /// Index of its step in the plan.
    pub step: usize,
    /// Exposures of this step before this one.
    pub attempt: u32,
    /// Whether it counts for its step.
    pub accepted: bool,
    /// What it belongs to: "plane 0", "arc", "dark", "repeat".
    pub sweep: String,
    /// Whether the lamp was on.
    pub lamp: bool,
    /// Light arm, measured, degrees.
    pub light_deg: f64,
    /// Sensor arm, measured, degrees.
    pub sensor_deg: f64,
    /// Zenith angle of the sensor, degrees.
    pub theta_r_deg: f64,
    /// Signed deviation from the mirror direction: |·| is d_p, positive towards the normal.
    pub deviation: f64,
    /// Counts of red, green, blue.
    pub counts: [u32; 3],
    /// Counts of the lamp monitor.
    pub monitor: u32,
    /// Gain factor.
    pub gain: u16,
    /// Integration time, µs.
    pub integration_us: u32,
    /// Temperature of the photometer, °C.
    pub temperature_c: u8,
    /// BRDF in sr⁻¹, red, green, blue, where the counts tell it.
    pub f: Option<[f64; 3]>,
    /// What to know about it.
    pub flags: Vec<String>,
    /// Seconds of rig time since the run began.
    pub time_s: f64,
}

impl From<&Measurement> for ReadingView {
    fn from(measurement: &Measurement) -> Self {
        let reading = &measurement.reading;
        let counts = &reading.counts;
        Self {
            step: reading.step,
            attempt: reading.attempt,
            accepted: reading.accepted,
            sweep: reading.sweep.to_string(),
            lamp: reading.lamp,
            light_deg: reading.measured.light.deg(),
            sensor_deg: reading.measured.sensor.deg(),
            theta_r_deg: measurement.theta_r.to_degrees(),
            deviation: measurement.deviation,
            counts: counts.rgb,
            monitor: counts.monitor,
            gain: counts.exposure.gain.into(),
            integration_us: counts.exposure.integration_us,
            temperature_c: counts.temperature_c,
            f: measurement.rgb().map(|rgb| rgb.to_array()),
            flags: reading
                .flags
                .iter()
                .map(|&flag| report::flag_name(flag).to_owned())
                .collect(),
            time_s: measurement.time_s,
        }
    }
}
