use capture::{Reading, Record};
use glam::DVec3;
use pdv::{Observation, Pdv};
use rig::{Dark, RigFile, Unusable};
use sweep::Sweep;

use crate::run::TICK_S;

/// A reading with what follows from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// The reading, raw.
    pub reading: Reading,
    /// Zenith angle of the sensor as measured, rad.
    pub theta_r: f64,
    /// Signed deviation from the mirror direction as measured; positive towards the normal, negative outwards.
    pub deviation: f64,
    /// Reflectance, linear RGB in sr⁻¹; `None` with the lamp off; an error where the counts say nothing.
    pub reflectance: Option<Result<DVec3, Unusable>>,
    /// Rig time since the start of the run, s.
    pub time_s: f64,
}

impl Measurement {
    /// PDV coordinates of the measured pose, φ_p 0 or π.
    pub fn pdv(&self) -> Pdv {
        Pdv::in_plane(self.theta_r, self.deviation)
    }

    /// Reflectance, where there is one.
    pub fn rgb(&self) -> Option<DVec3> {
        self.reflectance.and_then(Result::ok)
    }
}

/// Every reading of a journal with its place and its reflectance, in the order of the journal.
///
/// The sensor is taken as the viewer at azimuth 0, on whichever side of the normal it stands.
pub fn measurements(records: &[Record], rig: &RigFile) -> Vec<Measurement> {
    let begun = records.iter().find_map(|record| match record {
        Record::Begin { device_ticks, .. } => Some(*device_ticks),
        _ => None,
    });
    let begun = begun.unwrap_or_default();
    let readings = || {
        records.iter().filter_map(|record| match record {
            Record::Reading(reading) => Some(reading),
            _ => None,
        })
    };
    let dark = Dark::fit(readings().filter(|r| !r.lamp).map(|r| &r.counts));
    let reflectance = |reading: &Reading| {
        let rgb = rig
            .calibration
            .reflectance(&dark, reading.measured, &reading.counts);
        rgb.map(DVec3::from_array)
    };
    readings()
        .map(|reading| Measurement {
            theta_r: reading.measured.sensor.rad().abs(),
            deviation: reading.measured.deviation() * 1_f64.copysign(reading.measured.sensor.rad()),
            reflectance: reading.lamp.then(|| reflectance(reading)),
            time_s: reading.device_ticks.saturating_sub(begun) as f64 * TICK_S,
            reading: reading.clone(),
        })
        .collect()
}

/// What the accepted readings of one sweep observed.
pub fn observations(measurements: &[Measurement], sweep: Sweep) -> Vec<Observation> {
    measurements
        .iter()
        .filter(|m| m.reading.sweep == sweep && m.reading.accepted)
        .filter_map(|m| {
            Some(Observation {
                theta_r: m.theta_r,
                deviation: m.deviation,
                rgb: m.rgb()?,
            })
        })
        .collect()
}
