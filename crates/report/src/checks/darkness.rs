//! Whether the dark level is the one that was subtracted.

use capture::Record;
use rig::{Counts, Darks, RigFile, Taken};
use serde_json::json;

use crate::measurement::{all_taken, begun, believed, certificate, taken};
use crate::{Check, Measurement, Verdict};

/// By how many standard deviations a dark reading may differ from the level before.
const SIGMAS: f64 = 6.0;
/// By how many °C dark counts double at the fastest: silicon takes 5 to 8.
const DOUBLING_C: f64 = 5.0;
/// What a thermometer of whole degrees hides.
const ROUNDING_C: f64 = 1.0;

/// A dark level that changed between two sets, or between the last one and the end.
#[derive(Clone, Copy, Debug)]
struct Change {
    /// Rig time at which the earlier and the later level were seen, s.
    from_s: f64,
    to_s: f64,
    /// By how much, counts per µs at gain ×1.
    rate: [f64; 3],
}

/// The dark level is looked at again between the sweeps of a long run and at the end of each: light from outside that came
/// or went meanwhile is in the readings, and shows in nothing else.
pub(crate) fn darkness(measurements: &[Measurement], records: &[Record], rig: &RigFile) -> Check {
    let name = "dark level";
    let readings = all_taken(records);
    let begun = begun(records);
    let closing: Vec<Taken> = records
        .iter()
        .filter_map(|record| match record {
            Record::Repeat { reading, .. } if !reading.lamp => Some(taken(reading, begun)),
            _ => None,
        })
        .collect();
    let all = believed(&readings);
    let changes = changes(&all, &closing, rig);
    let affected = |m: &&Measurement| {
        let relevant = changes
            .iter()
            .filter(|change| (change.from_s..=change.to_s).contains(&m.time_s));
        relevant
            .into_iter()
            .any(|change| exceeds(change, m, records, rig))
    };
    let lit = measurements
        .iter()
        .filter(|m| m.reading.lamp && m.reading.accepted && m.u.is_some());
    let wrong = lit.clone().filter(affected).count();
    let looked = !closing.is_empty();
    let most = changes
        .iter()
        .flat_map(|change| change.rate)
        .fold(0.0, |a: f64, b| a.max(b.abs()));
    let (verdict, text) = match (wrong, looked) {
        (0, true) => (
            Verdict::Good,
            "The dark level at the end is the one that was subtracted, within the uncertainty of every reading.".to_owned(),
        ),
        (0, false) => (
            Verdict::Unknown,
            "The dark level was not looked at again at the end of the run.".to_owned(),
        ),
        (wrong, _) => (
            Verdict::Bad,
            format!(
                "The dark level changed during the run by {most:.2e} counts per µs: light came in from outside, or went. For \
                 {wrong} of {} readings that is more than their uncertainty. Close the door, darken the room, and measure again.",
                lit.count()
            ),
        ),
    };
    Check {
        name,
        verdict,
        text,
        values: json!({ "readings_affected": wrong, "largest_change": most, "looked_at_the_end": looked }),
    }
}

/// Levels that differ by more than noise and warmth explain, from each set to the next and from the last one to the end.
fn changes(all: &[Taken], closing: &[Taken], rig: &RigFile) -> Vec<Change> {
    let sets: Vec<&[Taken]> = all
        .chunk_by(|a, b| a.lamp == b.lamp)
        .filter(|set| !set[0].lamp)
        .collect();
    let after = |i: usize| sets.get(i + 1).copied().unwrap_or(closing);
    (0..sets.len())
        .filter_map(|i| change(sets[i], after(i), rig))
        .collect()
}

fn change(before: &[Taken], after: &[Taken], rig: &RigFile) -> Option<Change> {
    let (first, last) = (before.first()?, after.last()?);
    let darks = Darks::fit(before, rig.photometer.full_scale);
    let mut change = Change {
        from_s: first.time_s,
        to_s: last.time_s,
        rate: [0.0; 3],
    };
    for taken in after {
        let Some(off) = differences(&taken.counts, first, &darks, rig) else {
            continue;
        };
        for (most, off) in change.rate.iter_mut().zip(off) {
            if off.abs() > most.abs() {
                *most = off;
            }
        }
    }
    (change.rate != [0.0; 3]).then_some(change)
}

/// By how much a dark reading is off a level beyond noise and warmth, counts per µs at gain ×1; 0 where it is not.
fn differences(counts: &Counts, first: &Taken, darks: &Darks, rig: &RigFile) -> Option<[f64; 3]> {
    let exposure = counts.exposure;
    let known = darks.counts(first.time_s, exposure)?;
    let gain = exposure.gain.factor();
    let warmer = f64::from(counts.temperature_c.abs_diff(first.counts.temperature_c)) + ROUNDING_C;
    let growth = (warmer / DOUBLING_C).exp2() - 1.0;
    Some(std::array::from_fn(|c| {
        let off = f64::from(counts.rgb[c]) - known.rgb[c];
        // Of readings of one length alone nobody knows which part is offset, which does not grow.
        let current = match known.rgb[c] - known.offset[c] {
            current if current > 0.0 => current,
            _ => known.rgb[c].max(0.0),
        };
        let noise = rig.uncertainty.variance(current, gain) + known.u_rgb[c].powi(2);
        match off.abs() > SIGMAS * noise.sqrt() + growth * current {
            true => off / (gain * f64::from(exposure.integration_us)),
            false => 0.0,
        }
    }))
}

/// Whether a change is more than the expanded uncertainty that a reflectance has without it.
fn exceeds(change: &Change, m: &Measurement, records: &[Record], rig: &RigFile) -> bool {
    let Some(u) = m.u_but_for_dark() else {
        return false;
    };
    let white = certificate(records).and_then(|certificate| certificate.white.as_ref());
    let responsivity = white.map_or(rig.calibration.responsivity, |white| white.responsivity);
    let cosine = rig.calibration.filling.arm(m.pose).rad().cos();
    (0..3).any(|c| change.rate[c].abs() > u[c] * responsivity[c] * cosine)
}
