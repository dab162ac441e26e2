use std::collections::BTreeMap;

use serde_json::json;
use sweep::{Job, Sweep};

use super::COLOURS;
use crate::{Check, Measurement, Verdict};

/// Share of the lit readings of which no reflectance is known, above which the rest is no measurement of the specimen.
const UNUSABLE_LIMIT: f64 = 0.5;
/// Share of the reflectances of a colour that may be below zero by more than their expanded uncertainty: above the first
/// limit somebody should look, above the second the dark level or the stray light that was subtracted is wrong. By chance
/// it is one in forty.
const NEGATIVE_LIMITS: [f64; 2] = [0.1, 0.2];
/// Share of the reflectances of a colour that exceed their expanded uncertainty, below which no light of that colour was
/// seen: by chance it is one in forty.
const LIGHT_LIMIT: f64 = 0.05;
/// So many lit readings with the same counts are no coincidence: each is a sum of thousands of electrons.
const EQUAL_LIMIT: usize = 8;

/// What was found, and how bad it is.
type Found = (Verdict, String);

/// Whether the readings tell a reflectance at all, in every sweep and in every colour that the job asks for.
pub(crate) fn reflectance(measurements: &[Measurement], job: &Job) -> Check {
    let counts = |m: &&Measurement| m.reading.accepted && m.reading.sweep.is_measured() && !m.shadowed;
    let lit: Vec<&Measurement> = measurements.iter().filter(counts).collect();
    let usable: Vec<&Measurement> = lit.iter().copied().filter(|m| is_usable(m)).collect();
    let mut found = Vec::new();
    found.extend(unusable(&lit, usable.len()));
    found.extend(empty_sweeps(&lit, job));
    found.extend(equal(&lit));
    let wanted = job.scene.as_ref().map_or([true; 3], |scene| scene.channels);
    for c in (0..3).filter(|&c| wanted[c] && !usable.is_empty()) {
        found.extend(negative(&usable, c));
        found.extend(no_light(&usable, c));
    }
    let verdict = match found.iter().map(|(verdict, _)| *verdict).max() {
        Some(worst) => worst,
        None if lit.is_empty() => Verdict::Unknown,
        None => Verdict::Good,
    };
    let text = match found.is_empty() {
        true => format!(
            "Of {} lit readings that count, {} tell a reflectance, in every sweep and colour.",
            lit.len(),
            usable.len()
        ),
        false => found
            .into_iter()
            .map(|(_, text)| text)
            .collect::<Vec<_>>()
            .join(" "),
    };
    Check {
        name: "reflectance",
        verdict,
        text,
        values: json!({ "lit": lit.len(), "usable": usable.len() }),
    }
}

/// Whether a reading tells a reflectance: a number, with an uncertainty that is one.
fn is_usable(m: &Measurement) -> bool {
    m.rgb().is_some_and(glam::DVec3::is_finite) && m.u.is_some_and(glam::DVec3::is_finite)
}

/// Readings that count and tell nothing, with the reason that most of them have.
fn unusable(lit: &[&Measurement], usable: usize) -> Option<Found> {
    let lost = lit.len() - usable;
    if lost == 0 {
        return None;
    }
    let mut reasons: BTreeMap<String, usize> = BTreeMap::new();
    for m in lit.iter().filter(|m| !is_usable(m)) {
        let why = match m.reflectance {
            Some(Err(why)) => why.to_string(),
            _ => "the result is not a finite number".to_owned(),
        };
        *reasons.entry(why).or_default() += 1;
    }
    let (why, of) = reasons.into_iter().max_by_key(|&(_, count)| count)?;
    let verdict = match lost as f64 > UNUSABLE_LIMIT * lit.len() as f64 {
        true => Verdict::Bad,
        false => Verdict::Look,
    };
    Some((
        verdict,
        format!(
            "{lost} of {} lit readings tell no reflectance ({of} of them: {why}).",
            lit.len()
        ),
    ))
}

/// Sweeps that were read, but of which no reading tells anything.
fn empty_sweeps(lit: &[&Measurement], job: &Job) -> Vec<Found> {
    let planes = job.planes.iter().enumerate();
    let planes = planes.map(|(n, plane)| {
        (
            Sweep::Plane(n),
            format!("the plane at {:.0}°", plane.theta_r.to_degrees()),
        )
    });
    let legs = (0..job.legs.len()).map(|n| (Sweep::Leg(n), format!("leg {}", n + 1)));
    let arc = job.arc.iter().map(|_| (Sweep::Arc, "the arc".to_owned()));
    let empty = planes.chain(legs).chain(arc).filter(|(sweep, _)| {
        let mut of = lit.iter().filter(|m| m.reading.sweep == *sweep).peekable();
        of.peek().is_some() && !of.any(|m| is_usable(m))
    });
    empty
        .map(|(_, name)| (Verdict::Bad, format!("No reading of {name} tells a reflectance.")))
        .collect()
}

/// Readings that are all the same, although light and arms were not.
fn equal(lit: &[&Measurement]) -> Option<Found> {
    let (first, others) = lit.split_first()?;
    let same = |m: &&&Measurement| m.reading.counts.rgb == first.reading.counts.rgb;
    if lit.len() < EQUAL_LIMIT || !others.iter().all(|m| same(&m)) || first.reading.counts.saturated {
        return None;
    }
    Some((
        Verdict::Bad,
        format!(
            "All {} lit readings have the same counts ({:?}), which real light never has: the photometer is stuck.",
            lit.len(),
            first.reading.counts.rgb
        ),
    ))
}

/// Reflectances below zero by more than they are unsure.
fn negative(usable: &[&Measurement], c: usize) -> Option<Found> {
    let share = share(usable, |f, u| f < -u, c);
    let [look, bad] = NEGATIVE_LIMITS;
    if share <= look {
        return None;
    }
    let verdict = if share > bad { Verdict::Bad } else { Verdict::Look };
    Some((
        verdict,
        format!(
            "{:.0} % of the reflectances in {} are below zero by more than their uncertainty: the dark readings saw light, or the lamp was out.",
            100.0 * share,
            COLOURS[c]
        ),
    ))
}

/// A colour in which nothing was seen.
fn no_light(usable: &[&Measurement], c: usize) -> Option<Found> {
    let share = share(usable, |f, u| f > u, c);
    (share <= LIGHT_LIMIT).then(|| {
        let text = format!(
            "Hardly a reading ({:.0} % of {}) saw more light in {} than its uncertainty: the stage is empty, the lamp was out, or the specimen is black.",
            100.0 * share,
            usable.len(),
            COLOURS[c]
        );
        (Verdict::Bad, text)
    })
}

/// The share of readings whose reflectance in a colour is so, given how unsure it is whether there was light at all: what a
/// lobe does beside it says nothing of that.
fn share(usable: &[&Measurement], is: impl Fn(f64, f64) -> bool, c: usize) -> f64 {
    let such = usable.iter().filter(|m| {
        let (Some(f), Some(u)) = (m.rgb(), m.u_of_black()) else {
            return false;
        };
        is(f[c], u[c])
    });
    such.count() as f64 / usable.len() as f64
}
