use arms::Pose;
use capture::{Reading, Record};
use glam::DVec3;
use pdv::{Observation, Pdv};
use rig::{Budget, Certificate, Reduction, RigFile, Taken, Unusable};
use sweep::Sweep;

use crate::run::TICK_S;
use crate::uncertainty::{Sensitivity, expand};

/// A reading with what follows from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// The reading, raw.
    pub reading: Reading,
    /// Where the arms really were, by what was measured and the certificate's alignment.
    pub pose: Pose,
    /// Whether the arms shadowed each other there: planned around, so only where the alignment was not known before.
    pub shadowed: bool,
    /// Zenith angle of the sensor there, rad.
    pub theta_r: f64,
    /// Signed deviation from the mirror direction there; positive towards the normal, negative outwards.
    pub deviation: f64,
    /// Reflectance, linear RGB in sr⁻¹; `None` with the lamp off; an error where the counts say nothing.
    pub reflectance: Option<Result<DVec3, Unusable>>,
    /// The same in the sensor's own colours, before the colour matrix.
    pub raw: Option<DVec3>,
    /// How sure the reflectance is, as far as this reading can tell.
    pub budget: Option<Budget>,
    /// Expanded uncertainty of the reflectance, k = 2, sr⁻¹: all that is in the budget, the arms' angles and the
    /// apertures.
    pub u: Option<DVec3>,
    /// How the reflectance depends on the angles here.
    pub(crate) sensitivity: Sensitivity,
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
    let readings = all_taken(records);
    let all: Vec<Taken> = readings.iter().map(|(_, taken)| *taken).collect();
    let visits = readings
        .iter()
        .filter(|(reading, _)| reading.sweep == Sweep::Reference && reading.accepted);
    let visits: Vec<Taken> = visits.map(|(_, taken)| *taken).collect();
    let reduction = Reduction::new(rig, certificate(records), &all, &visits);
    let measure = |(reading, taken): &(&Reading, Taken)| {
        let reflectance = reading.lamp.then(|| reduction.reflectance(taken));
        let good = reflectance.and_then(Result::ok);
        let pose = reduction.aligned(reading.measured);
        Measurement {
            pose,
            shadowed: rig.envelope.occluded(pose),
            theta_r: pose.sensor.rad().abs(),
            deviation: pose.deviation() * 1_f64.copysign(pose.sensor.rad()),
            reflectance: reflectance.map(|result| result.map(|good| DVec3::from_array(good.rgb))),
            raw: good.map(|good| DVec3::from_array(good.raw)),
            budget: good.map(|good| good.u),
            u: None,
            sensitivity: Sensitivity::default(),
            time_s: taken.time_s,
            reading: (*reading).clone(),
        }
    };
    let mut measurements: Vec<Measurement> = readings.iter().map(measure).collect();
    expand(&mut measurements, records, rig);
    measurements
}

/// Every reading of a journal, in its order, also as calibrations see it.
pub(crate) fn all_taken(records: &[Record]) -> Vec<(&Reading, Taken)> {
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
        .map(|reading| {
            let taken = Taken {
                pose: reading.measured,
                time_s: reading.device_ticks.saturating_sub(begun) as f64 * TICK_S,
                lamp: reading.lamp,
                counts: reading.counts,
            };
            (reading, taken)
        })
        .collect()
}

/// The stored calibration that holds for a run, from its journal.
pub(crate) fn certificate(records: &[Record]) -> Option<&Certificate> {
    match records.first() {
        Some(Record::Header(header)) => header.certificate.as_deref(),
        _ => None,
    }
}

/// What the accepted readings of one sweep observed; those in shadow are left out.
pub fn observations(measurements: &[Measurement], sweep: Sweep) -> Vec<Observation> {
    measurements
        .iter()
        .filter(|m| m.reading.sweep == sweep && m.reading.accepted && !m.shadowed)
        .filter_map(|m| {
            Some(Observation {
                theta_r: m.theta_r,
                deviation: m.deviation,
                rgb: m.rgb()?,
            })
        })
        .collect()
}
