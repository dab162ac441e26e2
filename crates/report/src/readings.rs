use std::io;

use serde::Serialize;

use rig::Budget;

use crate::Measurement;
use crate::run::flag_name;
use crate::uncertainty::COVERAGE;

/// One row of readings.csv. The order of the columns is fixed; new ones come at the end.
#[derive(Serialize)]
struct Row {
    index: usize,
    sweep: String,
    light_commanded_deg: f64,
    sensor_commanded_deg: f64,
    light_measured_deg: f64,
    sensor_measured_deg: f64,
    theta_r_deg: f64,
    d_p: f64,
    phi_p_deg: f64,
    counts_r: u32,
    counts_g: u32,
    counts_b: u32,
    counts_monitor: u32,
    gain: u16,
    integration_us: u32,
    time_s: f64,
    f_r: Option<f64>,
    f_g: Option<f64>,
    f_b: Option<f64>,
    flags: String,
    step: usize,
    attempt: u32,
    accepted: bool,
    retries: u32,
    u_r: Option<f64>,
    u_g: Option<f64>,
    u_b: Option<f64>,
    raw_r: Option<f64>,
    raw_g: Option<f64>,
    raw_b: Option<f64>,
    shadowed: bool,
    light_swept_deg: Option<f64>,
    sensor_swept_deg: Option<f64>,
    exposures: usize,
    u_gain_r: Option<f64>,
    u_gain_g: Option<f64>,
    u_gain_b: Option<f64>,
    u_linearity_r: Option<f64>,
    u_linearity_g: Option<f64>,
    u_linearity_b: Option<f64>,
    u_colour_r: Option<f64>,
    u_colour_g: Option<f64>,
    u_colour_b: Option<f64>,
}

impl Row {
    fn new(index: usize, measurement: &Measurement) -> Self {
        let reading = &measurement.reading;
        let (pdv, rgb) = (measurement.pdv(), measurement.rgb());
        let term = |of: fn(&Budget) -> [f64; 3]| match &measurement.budget {
            Some(budget) => of(budget).map(|u| Some(COVERAGE * u)),
            None => [None; 3],
        };
        let [u_gain_r, u_gain_g, u_gain_b] = term(Budget::all_gains);
        let [u_linearity_r, u_linearity_g, u_linearity_b] = term(|budget| budget.linearity);
        let [u_colour_r, u_colour_g, u_colour_b] = term(|budget| budget.colour);
        let flags: Vec<&str> = reading.flags.iter().map(|&flag| flag_name(flag)).collect();
        Self {
            index,
            sweep: reading.sweep.to_string(),
            light_commanded_deg: reading.goal.light.deg(),
            sensor_commanded_deg: reading.goal.sensor.deg(),
            light_measured_deg: reading.measured.light.deg(),
            sensor_measured_deg: reading.measured.sensor.deg(),
            theta_r_deg: pdv.theta_r.to_degrees(),
            d_p: pdv.d_p,
            phi_p_deg: pdv.phi_p.to_degrees(),
            counts_r: reading.counts.rgb[0],
            counts_g: reading.counts.rgb[1],
            counts_b: reading.counts.rgb[2],
            counts_monitor: reading.counts.monitor,
            gain: reading.counts.exposure.gain.into(),
            integration_us: reading.counts.exposure.integration_us,
            time_s: measurement.time_s,
            f_r: rgb.map(|f| f.x),
            f_g: rgb.map(|f| f.y),
            f_b: rgb.map(|f| f.z),
            flags: flags.join("|"),
            step: reading.step,
            attempt: reading.attempt,
            accepted: reading.accepted,
            retries: reading.retries,
            u_r: measurement.u.map(|u| u.x),
            u_g: measurement.u.map(|u| u.y),
            u_b: measurement.u.map(|u| u.z),
            raw_r: measurement.raw.map(|f| f.x),
            raw_g: measurement.raw.map(|f| f.y),
            raw_b: measurement.raw.map(|f| f.z),
            shadowed: measurement.shadowed,
            light_swept_deg: reading.swept_rad.map(|[light, _]| light.to_degrees()),
            sensor_swept_deg: reading.swept_rad.map(|[_, sensor]| sensor.to_degrees()),
            exposures: measurement.exposures,
            u_gain_r,
            u_gain_g,
            u_gain_b,
            u_linearity_r,
            u_linearity_g,
            u_linearity_b,
            u_colour_r,
            u_colour_g,
            u_colour_b,
        }
    }
}

/// Writes readings.csv: one row a reading, in the order in which they were taken; reflectance in sr⁻¹, empty where a
/// reading has none (lamp off, saturated). `u` is the expanded uncertainty, k = 2; `raw` the reflectance in the sensor's
/// own colours, `swept` by how much an arm moved within an integration in flight; `exposures` is how many f is the mean
/// of: f and u of a reading that counts are of all exposures of its pose, the counts its own. `u_gain`, `u_linearity` and
/// `u_colour` are the terms of u (k = 2, sr⁻¹) that all readings of a gain, or of the run, have in common: what the gain
/// steps amplify by, the loss towards full scale, and the light of other colours in a channel.
///
/// # Errors
/// The medium refused.
pub fn write_readings(measurements: &[Measurement], out: impl io::Write) -> io::Result<()> {
    let mut writer = csv::Writer::from_writer(out);
    for (index, measurement) in measurements.iter().enumerate() {
        writer.serialize(Row::new(index, measurement))?;
    }
    writer.flush()
}
