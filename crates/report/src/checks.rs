use capture::{Reading, Record};
use glam::DVec3;
use pdv::Model;
use rig::Certificate;
use serde_json::json;

use crate::measurement::Told;
use crate::{Check, Measurement, Readings, Run, Verdict};

mod angles;
mod coverage;
mod darkness;
mod energy;
mod reflectance;
mod visits;

pub(crate) use angles::angles;
pub(crate) use coverage::coverage;
pub(crate) use darkness::darkness;
pub(crate) use energy::energy;
pub(crate) use reflectance::reflectance;
pub(crate) use visits::visits;

/// The channels, as texts call them.
const COLOURS: [&str; 3] = ["red", "green", "blue"];
/// Two readings of one pose may differ by so much before somebody should look: the repeatability of a good rig.
const REPEAT_LIMIT: f64 = 0.03;
/// A pose that is measured again when a run goes on may differ by so many of its expanded uncertainties, and at least by so
/// much, before what was measured until then cannot be believed: 6 standard deviations.
const RESUMED_SIGMAS: f64 = 3.0;
const RESUMED_LEAST: f64 = 0.01;
/// No dark level of a sound photometer changes what is bright enough to be compared by more than this.
const RESUMED_MOST_BY_DARK: f64 = 0.25;
/// Counts of the lamp monitor from which it tells something.
const MONITORED: u32 = 100;
/// The two sides of a lobe may differ by so much: beyond it the assumption of the model costs more than the rig does.
const SIDES_LIMIT: f64 = 0.10;

/// Whether what a run measured before it was interrupted still holds: one of its poses is measured again when it goes on. `None`
/// where it never was interrupted. What changed meanwhile, or was wrong just before, shows in nothing else.
pub(crate) fn resumed(measurements: &[Measurement], records: &[Record]) -> Option<Check> {
    // Each channel by itself: light from outside shows most in the faintest.
    let differs = |again: &Reading| {
        let before = measurements
            .iter()
            .filter(|m| m.reading.step == again.step && m.reading.accepted);
        before
            .filter_map(|m| {
                let rgb = m.rgb()?.abs();
                Some((m, m.u? / rgb, m.u_but_for_dark()? / rgb))
            })
            .any(|(m, u, u_but_for_dark)| {
                // Where nothing is on the monitor's port it tells nothing of the lamp.
                let monitored = again.counts.monitor.min(m.reading.counts.monitor) >= MONITORED;
                let level = |reading: &Reading, c: usize| {
                    let lamp = if monitored { reading.counts.monitor } else { 1 };
                    f64::from(reading.counts.rgb[c]) / f64::from(lamp)
                };
                (0..3).any(|c| {
                    let difference = level(again, c) / level(&m.reading, c).max(f64::MIN_POSITIVE) - 1.0;
                    let allowed = (RESUMED_SIGMAS * u[c]).max(RESUMED_LEAST);
                    let by_dark = (RESUMED_SIGMAS * u_but_for_dark[c]).max(RESUMED_MOST_BY_DARK);
                    difference.abs() > allowed.min(by_dark)
                })
            })
    };
    let repeats: Vec<(f64, bool)> = records
        .iter()
        .filter_map(|record| match record {
            Record::Repeat {
                reading,
                difference_rel,
            } if reading.lamp => Some((*difference_rel, differs(reading))),
            _ => None,
        })
        .collect();
    let worst = repeats
        .iter()
        .map(|(difference, _)| difference.abs())
        .reduce(f64::max)?;
    let bad = repeats.iter().filter(|(_, differs)| *differs).count();
    let (verdict, text) = match (bad, limit(worst, REPEAT_LIMIT)) {
        (0, Verdict::Good) => (
            Verdict::Good,
            format!(
                "A pose that was measured again when the run went on differs by at most {:.2} %.",
                100.0 * worst
            ),
        ),
        (0, verdict) => (
            verdict,
            format!(
                "A pose that was measured again when the run went on differs by up to {:.1} %, within its uncertainty.",
                100.0 * worst
            ),
        ),
        (bad, _) => (
            Verdict::Bad,
            format!(
                "A pose that was measured again when the run went on differs by up to {:.1} %, more than its uncertainty, \
                 {bad} of {} times: specimen, lamp or room are not what they were, or something was wrong before the \
                 interruption. Measure anew.",
                100.0 * worst,
                repeats.len()
            ),
        ),
    };
    Some(Check {
        name: "resumed",
        verdict,
        text,
        values: json!({ "differences": repeats.iter().map(|(difference, _)| difference).collect::<Vec<_>>() }),
    })
}

/// Whether there is a reconstruction: without one a complete run has no result.
pub(crate) fn reconstruction(model: Option<&dyn Model>, no_model: Option<&str>, complete: bool) -> Check {
    let (verdict, text) = match (model, no_model) {
        (Some(model), _) => (Verdict::Good, format!("The reconstruction is {}.", model.about())),
        (None, why) => (
            if complete { Verdict::Bad } else { Verdict::Unknown },
            format!(
                "There is no reconstruction: {}.",
                why.unwrap_or("nobody knows why")
            ),
        ),
    };
    Check {
        name: "reconstruction",
        verdict,
        text,
        values: json!({ "model": model.map(Model::about), "no_model": no_model }),
    }
}

/// The plane and the arc cross at one pose, which was therefore measured twice: G(x) against the arc.
pub(crate) fn crossing(plane: &[Told], arc: &[Told], theta_r: f64, offset: f64) -> Check {
    let name = "plane against arc";
    let along_plane: Vec<_> = plane
        .iter()
        .map(|told| (told.at.deviation, told.value()))
        .collect();
    let along_arc: Vec<_> = arc.iter().map(|told| (told.at.theta_r, told.value())).collect();
    let degrees = theta_r.to_degrees();
    let (Some(g), Some(f)) = (between(along_plane, offset), between(along_arc, theta_r)) else {
        return Check {
            name,
            verdict: Verdict::Unknown,
            text: format!("The plane at {degrees:.0}° and the arc do not cross within what was measured."),
            values: json!({ "theta_r_deg": degrees }),
        };
    };
    let apart = Apart::of(g, f, REPEAT_LIMIT);
    Check {
        name,
        verdict: apart.verdict(),
        text: format!(
            "Where the plane at {degrees:.0}° and the arc cross, the same pose was measured twice; the two differ by {:.2} % ({}).",
            100.0 * apart.difference,
            apart.allowed()
        ),
        values: json!({
            "theta_r_deg": degrees,
            "g": g.rgb.to_array(),
            "arc": f.rgb.to_array(),
            "difference": apart.difference,
            "uncertainty": apart.uncertainty,
        }),
    }
}

/// Two planes share poses in which light and sensor have changed places (Helmholtz): the sensor of either stands where
/// the light of the other does, on the same side of the normal and on the other.
pub(crate) fn helmholtz(first: (&[Told], f64), second: (&[Told], f64)) -> Check {
    let name = "light and sensor swapped";
    let [a, b] = [first.1, second.1];
    let at = |(plane, theta_r): (&[Told], f64), light: f64| {
        let readings = plane
            .iter()
            .map(|told| (told.at.deviation, told.value()))
            .collect();
        between(readings, light.sin() + theta_r.sin())
    };
    let pairs: Vec<[Value; 2]> = [1.0, -1.0]
        .into_iter()
        .filter_map(|side| Some([at(first, side * b)?, at(second, side * a)?]))
        .collect();
    let degrees = [a, b].map(f64::to_degrees);
    let which = format!("The planes at {:.0}° and {:.0}°", degrees[0], degrees[1]);
    let worst = pairs
        .iter()
        .map(|&[f, g]| Apart::of(f, g, SIDES_LIMIT))
        .max_by(|a, b| a.excess().total_cmp(&b.excess()));
    let values = json!({
        "theta_r_deg": degrees,
        "difference": worst.map(|apart| apart.difference),
        "uncertainty": worst.map(|apart| apart.uncertainty),
        "pairs": pairs.iter().map(|pair| pair.map(|value| value.rgb.to_array())).collect::<Vec<_>>(),
    });
    let Some(worst) = worst else {
        return Check {
            name,
            verdict: Verdict::Unknown,
            text: format!("{which} share no pose with light and sensor swapped within what was measured."),
            values,
        };
    };
    Check {
        name,
        verdict: worst.verdict(),
        text: format!(
            "{which} share {} poses with light and sensor swapped, interpolated between readings; they differ by {:.1} % at most ({}).",
            pairs.len(),
            100.0 * worst.difference,
            worst.allowed()
        ),
        values,
    }
}

/// The two sides of a plane at the same d_p: what a model that is constant along φ_p takes to be equal.
pub(crate) fn sides(plane: &[Told], theta_r: f64, taken_as_equal: bool) -> Check {
    let name = "both sides of the mirror direction";
    let side = |sign: f64| -> Vec<(f64, Value)> {
        let on_side = plane.iter().filter(|told| told.at.deviation * sign > 0.0);
        on_side
            .map(|told| (told.at.deviation.abs(), told.value()))
            .collect()
    };
    let (inner, outer) = (side(1.0), side(-1.0));
    // Of each reading, and how unsure that is.
    let (mut differences, mut unsure): (Vec<f64>, Vec<f64>) = outer
        .iter()
        .filter_map(|&(d_p, outwards)| {
            let inwards = between(inner.clone(), d_p)?;
            let ratio = (outwards.rgb / inwards.rgb).map(|r| r.max(f64::MIN_POSITIVE).ln().abs());
            let unsure = (outwards.u / outwards.rgb)
                .length()
                .max((inwards.u / inwards.rgb).length());
            (ratio.is_finite() && unsure.is_finite()).then(|| {
                let apart = Apart::of(outwards, inwards, SIDES_LIMIT);
                (ratio.max_element(), apart.uncertainty)
            })
        })
        .unzip();
    differences.sort_by(f64::total_cmp);
    unsure.sort_by(f64::total_cmp);
    let degrees = theta_r.to_degrees();
    let Some(&median) = differences.get(differences.len() / 2) else {
        return Check {
            name,
            verdict: Verdict::Unknown,
            text: format!(
                "The plane at {degrees:.0}° was measured on one side of the mirror direction only."
            ),
            values: json!({ "theta_r_deg": degrees }),
        };
    };
    let uncertainty = unsure[unsure.len() / 2];
    Check {
        name,
        verdict: match taken_as_equal {
            true => limit(median, SIDES_LIMIT.max(uncertainty)),
            false => Verdict::Good,
        },
        text: format!(
            "At {degrees:.0}° the two sides of the mirror direction differ by {:.1} % in the median over {} readings; the model {}.",
            100.0 * median.exp_m1(),
            differences.len(),
            if taken_as_equal {
                "takes them to be equal"
            } else {
                "has each of them for itself"
            }
        ),
        values: json!({
            "theta_r_deg": degrees,
            "median_log_ratio": median,
            "uncertainty": uncertainty,
            "readings": differences.len(),
        }),
    }
}

/// Retries, and readings that count although they are saturated or too dim.
pub(crate) fn bus(run: &Run) -> Check {
    let Readings {
        taken,
        accepted,
        poor,
        ..
    } = run.readings;
    let again = taken - accepted;
    let repeated = match again {
        0 => "none was taken again".to_owned(),
        n => format!(
            "{n} more were taken with another exposure, which took {} of the {} of light of all readings",
            seconds(run.seconds.again),
            seconds(run.seconds.light)
        ),
    };
    Check {
        name: "readings",
        verdict: if poor > 0 { Verdict::Look } else { Verdict::Good },
        text: format!(
            "{accepted} readings count, {repeated}; {poor} of those that count are saturated or too dim; {} requests on the bus were repeated.",
            run.retries
        ),
        values: json!({ "readings": run.readings, "retries": run.retries, "flags": run.flags }),
    }
}

/// A time in words: in milliseconds where it would read as no time at all.
fn seconds(time_s: f64) -> String {
    match time_s {
        short if short < 1e-3 => "less than 1 ms".to_owned(),
        short if short < 0.95 => format!("{:.0} ms", short * 1e3),
        long => format!("{long:.1} s"),
    }
}

/// What is to be said of the certificate with which the run was calibrated.
pub(crate) fn calibration(certificate: Option<&Certificate>) -> Option<Check> {
    let certificate = certificate?;
    let good = format!(
        "The calibration {} agrees with what was known before it.",
        certificate.id
    );
    Some(Check {
        name: "calibration",
        verdict: match certificate.remarks.is_empty() {
            true => Verdict::Good,
            false => Verdict::Look,
        },
        text: match certificate.remarks.as_slice() {
            [] => good,
            remarks => remarks.join(" "),
        },
        values: json!({ "id": certificate.id, "number": certificate.number, "remarks": certificate.remarks }),
    })
}

fn limit(value: f64, limit: f64) -> Verdict {
    if value <= limit {
        Verdict::Good
    } else {
        Verdict::Look
    }
}

/// A reflectance and its expanded uncertainty, k = 2, sr⁻¹.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Value {
    rgb: DVec3,
    u: DVec3,
}

impl Told {
    fn value(&self) -> Value {
        Value {
            rgb: self.at.rgb,
            u: self.u,
        }
    }
}

/// By how much two values differ that should be one, in the channel that stands out most, and how much is nothing to look
/// at: what a good rig differs by, or what the two are uncertain by.
#[derive(Clone, Copy, Debug)]
struct Apart {
    /// Relative to their mean.
    difference: f64,
    /// Expanded, k = 2, of that.
    uncertainty: f64,
    limit: f64,
}

impl Apart {
    fn of(a: Value, b: Value, limit: f64) -> Self {
        let mean = (0.5 * (a.rgb + b.rgb)).max(DVec3::splat(f64::MIN_POSITIVE));
        let differences = ((a.rgb - b.rgb) / mean).abs();
        let channel = |c: usize| Self {
            difference: differences[c],
            uncertainty: a.u[c].hypot(b.u[c]) / mean[c],
            limit,
        };
        let channels = [channel(1), channel(2)].into_iter();
        channels.fold(channel(0), |worst, other| {
            if other.excess() > worst.excess() {
                other
            } else {
                worst
            }
        })
    }

    fn excess(self) -> f64 {
        self.difference - self.limit.max(self.uncertainty)
    }

    fn verdict(self) -> Verdict {
        limit(self.difference, self.limit.max(self.uncertainty))
    }

    /// Up to where it is good, in words.
    fn allowed(self) -> String {
        if self.uncertainty > self.limit {
            let percent = 100.0 * self.uncertainty;
            format!("up to {percent:.1} % is within their uncertainty")
        } else {
            format!("up to {:.0} % is good", 100.0 * self.limit)
        }
    }
}

/// Value at `x` between the two nearest of `points`, linear in ln(1 + f), and as unsure as they are; `None` outside of them.
fn between(mut points: Vec<(f64, Value)>, x: f64) -> Option<Value> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let at = points.partition_point(|point| point.0 < x);
    let &(x1, f1) = points.get(at)?;
    if x1 == x {
        return Some(f1);
    }
    let (x0, f0) = points[at.checked_sub(1)?];
    let t = (x - x0) / (x1 - x0);
    let log = |f: Value| f.rgb.map(f64::ln_1p);
    Some(Value {
        rgb: (log(f0) * (1.0 - t) + log(f1) * t).map(f64::exp_m1),
        u: f0.u * (1.0 - t) + f1.u * t,
    })
}

#[cfg(test)]
mod tests {
    use pdv::Observation;

    use super::*;

    #[test]
    fn no_time_of_light_reads_as_none() {
        let words = [1e-4, 0.0134, 0.94, 0.96, 8.94].map(seconds);
        assert_eq!(words, ["less than 1 ms", "13 ms", "940 ms", "1.0 s", "8.9 s"]);
    }

    #[test]
    fn light_and_sensor_may_be_swapped_in_a_reciprocal_specimen_only() {
        let plane = |theta_r: f64, factor: f64, u: f64| -> Vec<Told> {
            let material = brdf::Fitted::named("blue-rubber").unwrap();
            let at = |n: i32| Observation::of(&material, theta_r, f64::from(n) * 0.01);
            let read = (-99..199).filter_map(at);
            read.map(|o| Told {
                at: Observation {
                    rgb: o.rgb * factor,
                    ..o
                },
                u: o.rgb * u,
            })
            .collect()
        };
        let (first, good, bad) = (plane(0.3, 1.0, 0.0), plane(0.8, 1.0, 0.0), plane(0.8, 1.3, 0.0));
        // What is unsure by as much as it is off has nothing to look at.
        let (unsure, rather_unsure) = (plane(0.8, 1.3, 0.4), plane(0.8, 1.3, 0.2));
        let check = helmholtz((&first, 0.3), (&good, 0.8));
        assert_eq!(check.verdict, Verdict::Good, "{}", check.text);
        assert_eq!(check.values["pairs"].as_array().unwrap().len(), 2);
        let verdict = |second: &[Told]| helmholtz((&first, 0.3), (second, 0.8)).verdict;
        assert_eq!(verdict(&bad), Verdict::Look);
        assert_eq!(verdict(&rather_unsure), Verdict::Look);
        assert_eq!(verdict(&unsure), Verdict::Good);
        assert_eq!(
            helmholtz((&first, 0.3), (&bad[..1], 0.8)).verdict,
            Verdict::Unknown
        );
    }

    #[test]
    fn interpolation_is_exact_at_the_points_and_refuses_what_lies_outside() {
        let value = |rgb: f64, u: f64| Value {
            rgb: DVec3::splat(rgb),
            u: DVec3::splat(u),
        };
        let points = vec![(2.0, value(5.0, 0.2)), (1.0, value(3.0, 0.1))];
        assert_eq!(between(points.clone(), 1.0), Some(value(3.0, 0.1)));
        assert_eq!(between(points.clone(), 2.0), Some(value(5.0, 0.2)));
        assert_eq!(between(points.clone(), 0.5), None);
        assert_eq!(between(points.clone(), 2.5), None);
        let middle = between(points, 1.5).unwrap();
        assert!(
            (middle.rgb.x - (24.0_f64.sqrt() - 1.0)).abs() < 1e-12,
            "{middle:?}"
        );
        assert!((middle.u.x - 0.15).abs() < 1e-12, "{middle:?}");
    }
}
