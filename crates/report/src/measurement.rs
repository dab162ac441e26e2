use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use arms::Pose;
use capture::{Reading, Record, extended_plan};
use glam::DVec3;
use pdv::{Observation, Pdv};
use rig::{Budget, Certificate, Reduction, RigFile, Taken, Unusable};
use sweep::Sweep;

use crate::alignment::{Alignment, leans};
use crate::run::TICK_S;
use crate::sensitivity::Sensitivity;
use crate::uncertainty::{COVERAGE, expand, zeros};

/// A reading with what follows from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// The reading, raw.
    pub reading: Reading,
    /// Where the arms were at the specimen, by what was measured, the certificate and the alignment.
    pub pose: Pose,
    /// Which way each arm leant against its encoder, −1 … 1: +1 where it had moved towards larger angles.
    pub(crate) lean: [f64; 2],
    /// What the run's own lobes say of its angles.
    pub(crate) alignment: Arc<Alignment>,
    /// Whether the arms may have shadowed each other there, within the integration and as far as the zeros are known.
    /// Plans keep clear of it.
    pub shadowed: bool,
    /// Zenith angle of the sensor there, rad.
    pub theta_r: f64,
    /// Signed deviation from the mirror direction there; positive towards the normal, negative outwards.
    pub deviation: f64,
    /// Reflectance, linear RGB in sr⁻¹; `None` with the lamp off; an error where the counts say nothing. Of a reading
    /// that counts it is the mean over all exposures of its pose, of each channel by inverse variance.
    pub reflectance: Option<Result<DVec3, Unusable>>,
    /// How many exposures that is made of; 0 where there is none.
    pub exposures: usize,
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

    /// Expanded uncertainty, k = 2, sr⁻¹, of whether there was light at all: counting noise, dark level and stray light, which
    /// a reading of nothing has as well.
    pub(crate) fn u_of_black(&self) -> Option<DVec3> {
        let budget = self.budget?;
        let squares = [budget.counting, budget.dark, budget.stray].map(|u| DVec3::from_array(u).powf(2.0));
        Some(COVERAGE * squares.into_iter().sum::<DVec3>().map(f64::sqrt))
    }

    /// Expanded uncertainty, k = 2, sr⁻¹, but for the dark level: of two levels that disagree a reading is as uncertain as they
    /// are apart, so that neither is ever out of it.
    pub(crate) fn u_but_for_dark(&self) -> Option<DVec3> {
        let (u, dark) = (self.u?, COVERAGE * DVec3::from_array(self.budget?.dark));
        Some((u * u - dark * dark).max(DVec3::ZERO).map(f64::sqrt))
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
    let believed = believed(&readings);
    let visits = readings
        .iter()
        .filter(|(reading, _)| reading.sweep == Sweep::Reference && reading.accepted);
    let visits: Vec<Taken> = visits.map(|(_, taken)| *taken).collect();
    let reduction = Reduction::new(rig, certificate(records), &believed, &visits);
    let stays = stays(records);
    let leans = leans(
        &readings.iter().map(|(reading, _)| *reading).collect::<Vec<_>>(),
        rig,
    );
    let measure = |alignment: &Arc<Alignment>, i: usize| {
        let (reading, taken) = readings[i];
        let exposures = match reading.accepted {
            true => &all[together(&stays, i)],
            false => std::slice::from_ref(&all[i]),
        };
        let pose = alignment.aligned(reduction.aligned(reading.measured), reading.sweep, leans[i]);
        let reflectance = reading.lamp.then(|| reduction.combined_at(pose, exposures));
        let good = reflectance.and_then(Result::ok);
        Measurement {
            pose,
            lean: leans[i],
            alignment: alignment.clone(),
            shadowed: rig.shadowed(pose, reading.swept_rad.unwrap_or_default()),
            theta_r: pose.sensor.rad().abs(),
            deviation: pose.deviation() * 1_f64.copysign(pose.sensor.rad()),
            reflectance: reflectance.map(|result| result.map(|good| DVec3::from_array(good.rgb))),
            exposures: good.map_or(0, |good| good.exposures),
            raw: good.map(|good| DVec3::from_array(good.raw)),
            budget: good.map(|good| good.u),
            u: None,
            sensitivity: Sensitivity::default(),
            time_s: taken.time_s,
            reading: reading.clone(),
        }
    };
    let with = |alignment: Alignment| -> Vec<Measurement> {
        let alignment = Arc::new(alignment);
        (0..readings.len()).map(|i| measure(&alignment, i)).collect()
    };
    let zeros = zeros(records, rig);
    let by_certificate = with(Alignment::none());
    let alignment = Alignment::new(&by_certificate, rig, zeros);
    let mut measurements = match alignment.told.is_empty() {
        false => with(alignment),
        // Nothing is corrected, so that nothing need be reduced again.
        true => {
            let alignment = Arc::new(alignment);
            let known = |m: Measurement| Measurement {
                alignment: alignment.clone(),
                ..m
            };
            by_certificate.into_iter().map(known).collect()
        }
    };
    sharpen(&mut measurements, records);
    expand(&mut measurements, zeros, rig);
    measurements
}

/// For each reading of a journal, in its order, the number of the stay at a pose in which it was taken, ascending: as
/// long as the arms rest there, exposures tell the same. In flight each reading is one by itself.
fn stays(records: &[Record]) -> Vec<usize> {
    let mut stays = Vec::new();
    let mut last: Option<&Reading> = None;
    for record in records {
        match record {
            Record::Begin { .. } => last = None,
            Record::Reading(reading) => {
                let rests = |last: &Reading| {
                    let at_rest = last.swept_rad.is_none() && reading.swept_rad.is_none();
                    at_rest && last.step == reading.step && last.measured == reading.measured
                };
                let before = stays.last().copied().unwrap_or_default();
                stays.push(if last.is_some_and(rests) {
                    before
                } else {
                    before + 1
                });
                last = Some(reading);
            }
            _ => {}
        }
    }
    stays
}

/// The readings of the same stay as the `i`-th.
fn together(stays: &[usize], i: usize) -> Range<usize> {
    stays.partition_point(|&stay| stay < stays[i])..stays.partition_point(|&stay| stay <= stays[i])
}

/// Every reading of a journal, in its order, also as calibrations see it.
pub(crate) fn all_taken(records: &[Record]) -> Vec<(&Reading, Taken)> {
    let begun = begun(records);
    let readings = records.iter().filter_map(|record| match record {
        Record::Reading(reading) => Some(reading),
        _ => None,
    });
    readings.map(|reading| (reading, taken(reading, begun))).collect()
}

/// The photometer's ticks when a run began.
pub(crate) fn begun(records: &[Record]) -> u64 {
    let begun = records.iter().find_map(|record| match record {
        Record::Begin { device_ticks, .. } => Some(*device_ticks),
        _ => None,
    });
    begun.unwrap_or_default()
}

/// A reading as calibrations see it, of a run that began at these ticks.
pub(crate) fn taken(reading: &Reading, begun: u64) -> Taken {
    Taken {
        pose: reading.measured,
        time_s: reading.device_ticks.saturating_sub(begun) as f64 * TICK_S,
        lamp: reading.lamp,
        counts: reading.counts,
    }
}

/// What a reduction is made of: dark readings of a set that was not believed are left out.
pub(crate) fn believed(readings: &[(&Reading, Taken)]) -> Vec<Taken> {
    let believed = readings
        .iter()
        .filter(|(reading, _)| reading.lamp || reading.accepted);
    believed.map(|(_, taken)| *taken).collect()
}

/// The stored calibration that holds for a run, from its journal.
pub(crate) fn certificate(records: &[Record]) -> Option<&Certificate> {
    match records.first() {
        Some(Record::Header(header)) => header.certificate.as_deref(),
        _ => None,
    }
}

/// Takes from the readings of each flight what the motion within their integrations has added, by the readings next to
/// them.
fn sharpen(measurements: &mut [Measurement], records: &[Record]) {
    let plan = extended_plan(records);
    let mut flights: HashMap<usize, Vec<usize>> = HashMap::new();
    for (i, m) in measurements.iter().enumerate() {
        let step = plan.as_ref().and_then(|plan| plan.steps.get(m.reading.step));
        let counts = m.reading.accepted && m.reading.swept_rad.is_some() && m.rgb().is_some();
        if let (true, Some(pass)) = (counts, step.and_then(|step| step.pass)) {
            flights.entry(pass).or_default().push(i);
        }
    }
    for members in flights.values() {
        let along = capture::along(members.iter().map(|&i| measurements[i].pose));
        let channel = |c: usize| -> Vec<(f64, f64)> {
            let value = |&i: &usize| measurements[i].rgb().unwrap_or_default()[c];
            along.iter().copied().zip(members.iter().map(value)).collect()
        };
        let points = [channel(0), channel(1), channel(2)];
        for (at, &i) in members.iter().enumerate() {
            let [light, sensor] = measurements[i].reading.swept_rad.unwrap_or_default();
            let width = light.hypot(sensor);
            let added = points.each_ref().map(|points| capture::blur(points, at, width));
            let sharp = measurements[i].rgb().map(|rgb| {
                // Beside a peak that is narrower than its readings are apart a parabola says what no lobe does; of what the
                // capture let count the motion has added less.
                let most = MOST_BLUR * rgb.abs();
                Ok(rgb - DVec3::from_array(added).clamp(-most, most))
            });
            measurements[i].reflectance = sharp;
        }
    }
}

/// Share of a reflectance that motion may have added to it: twice what a capture lets count.
const MOST_BLUR: f64 = 0.1;

/// Share of a reflectance that one reading differs from the next of the same pose by, whatever its counts: no reading
/// weighs more than that is worth.
const REPRODUCIBLE: f64 = 0.01;

/// The measurements of one sweep that count, by their place in the list, those of one pose together: a flight may pass it
/// there and back. Those in shadow are left out.
pub(crate) fn visits(measurements: &[Measurement], sweep: Sweep) -> Vec<Vec<usize>> {
    let mut places: HashMap<[u64; 2], usize> = HashMap::new();
    let mut visits: Vec<Vec<usize>> = Vec::new();
    for (i, m) in measurements.iter().enumerate() {
        if m.reading.sweep != sweep || !m.reading.accepted || m.shadowed || m.rgb().is_none() {
            continue;
        }
        let goal = m.reading.goal;
        let place = [goal.light, goal.sensor].map(|angle| angle.rad().to_bits());
        let at = *places.entry(place).or_insert(visits.len());
        match visits.get_mut(at) {
            Some(visit) => visit.push(i),
            None => visits.push(vec![i]),
        }
    }
    visits
}

/// The measurements of one visit as one observation, each by the inverse of its variance; `rgb` says what each saw.
pub(crate) fn observation(
    measurements: &[Measurement],
    visit: &[usize],
    mut rgb: impl FnMut(&Measurement) -> Option<DVec3>,
) -> Option<Observation> {
    let mut sum = Observation {
        theta_r: 0.0,
        deviation: 0.0,
        rgb: DVec3::ZERO,
    };
    let mut weights = 0.0;
    for m in visit.iter().map(|&i| &measurements[i]) {
        let total = |of: DVec3| of.element_sum().abs().max(f64::MIN_POSITIVE);
        let counting = m
            .budget
            .map_or(DVec3::ZERO, |budget| DVec3::from_array(budget.counting));
        let relative = counting.length() / total(m.rgb()?);
        let weight = 1.0 / (relative * relative + REPRODUCIBLE * REPRODUCIBLE);
        sum.theta_r += weight * m.theta_r;
        sum.deviation += weight * m.deviation;
        sum.rgb += weight * rgb(m)?;
        weights += weight;
    }
    (weights > 0.0).then(|| Observation {
        theta_r: sum.theta_r / weights,
        deviation: sum.deviation / weights,
        rgb: sum.rgb / weights,
    })
}

/// What the readings of one pose tell together, and how sure that is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Told {
    /// What was observed there.
    pub(crate) at: Observation,
    /// Expanded uncertainty of the reflectance, k = 2, sr⁻¹: of one of its readings, for most of it is common to them.
    pub(crate) u: DVec3,
}

/// What one sweep tells, as [`observations`], with its uncertainty where it is known.
pub(crate) fn told(measurements: &[Measurement], sweep: Sweep) -> Vec<Told> {
    let of_visit = |visit: &Vec<usize>| {
        let at = observation(measurements, visit, Measurement::rgb)?;
        let unsure = visit.iter().filter_map(|&i| measurements[i].u);
        let u = unsure.reduce(DVec3::max).unwrap_or_default();
        Some(Told { at, u })
    };
    visits(measurements, sweep).iter().filter_map(of_visit).collect()
}

/// What one sweep observed: the readings of each pose together, those in shadow left out.
pub fn observations(measurements: &[Measurement], sweep: Sweep) -> Vec<Observation> {
    visits(measurements, sweep)
        .iter()
        .filter_map(|visit| observation(measurements, visit, Measurement::rgb))
        .collect()
}
