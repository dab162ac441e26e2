use arms::Pose;
use capture::{Reading, Record};
use glam::DVec3;
use pdv::Pdv;
use rig::RigFile;

use crate::run::TICK_S;

/// A reading with what follows from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// The reading, raw.
    pub reading: Reading,
    /// Where it lies, from the measured pose.
    pub pdv: Pdv,
    /// Reflectance, linear RGB in sr⁻¹; `None` for lamp-off and saturated readings.
    pub reflectance: Option<DVec3>,
    /// Rig time since the start of the run, s.
    pub time_s: f64,
}

/// Every reading of a journal with its place in PDV coordinates and its reflectance, in the order of the journal.
pub fn observe(records: &[Record], _rig: &RigFile) -> Vec<Observation> {
    let begun = records.iter().find_map(|record| match record {
        Record::Begin { device_ticks, .. } => Some(*device_ticks),
        _ => None,
    });
    let begun = begun.unwrap_or_default();
    let readings = records.iter().filter_map(|record| match record {
        Record::Reading(reading) => Some(reading),
        _ => None,
    });
    readings
        .map(|reading| Observation {
            reading: reading.clone(),
            pdv: pdv(reading.measured),
            reflectance: None,
            time_s: reading.device_ticks.saturating_sub(begun) as f64 * TICK_S,
        })
        .collect()
}

/// PDV coordinates of a pose, the sensor taken as the viewer at azimuth 0 on whichever side it stands.
fn pdv(pose: Pose) -> Pdv {
    let sensor = pose.sensor.rad();
    Pdv::in_plane(sensor.abs(), pose.deviation() * 1_f64.copysign(sensor))
}
