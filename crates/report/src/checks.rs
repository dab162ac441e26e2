use brdf::{Brdf, Spherical};
use glam::DVec3;
use pdv::{Basis, Model, Observation, albedo};
use serde_json::json;

use crate::{Check, Readings, Run, Verdict};

/// Two readings of one pose may differ by so much before somebody should look: the repeatability of a good rig.
const REPEAT_LIMIT: f64 = 0.03;
/// The two sides of a lobe may differ by so much: beyond it the assumption of the model costs more than the rig does.
const SIDES_LIMIT: f64 = 0.10;
/// So much may be extrapolated: a plane at 70° with ordinary limits leaves less out.
const COVERAGE_LIMIT: f64 = 0.10;
/// Directions at which the albedo is checked, degrees.
const ALBEDO_DEG: [f64; 4] = [0.0, 30.0, 60.0, 75.0];

/// The plane and the arc cross at one pose, which was therefore measured twice: G(x) against the arc.
pub(crate) fn crossing(plane: &[Observation], arc: &[Observation], theta_r: f64, offset: f64) -> Check {
    let name = "plane against arc";
    let along_plane: Vec<_> = plane.iter().map(|o| (o.deviation, o.rgb)).collect();
    let along_arc: Vec<_> = arc.iter().map(|o| (o.theta_r, o.rgb)).collect();
    let degrees = theta_r.to_degrees();
    let (Some(g), Some(f)) = (between(along_plane, offset), between(along_arc, theta_r)) else {
        return Check {
            name,
            verdict: Verdict::Unknown,
            text: format!("The plane at {degrees:.0}° and the arc do not cross within what was measured."),
            values: json!({ "theta_r_deg": degrees }),
        };
    };
    let difference = (2.0 * (g - f) / (g + f).max(DVec3::splat(f64::MIN_POSITIVE)))
        .abs()
        .max_element();
    Check {
        name,
        verdict: limit(difference, REPEAT_LIMIT),
        text: format!(
            "Where the plane at {degrees:.0}° and the arc cross, the same pose was measured twice; the two differ by {:.2} % (up to {:.0} % is good).",
            100.0 * difference,
            100.0 * REPEAT_LIMIT
        ),
        values: json!({ "theta_r_deg": degrees, "g": g.to_array(), "arc": f.to_array(), "difference": difference }),
    }
}

/// Two planes share poses in which light and sensor have changed places (Helmholtz): the sensor of either stands where
/// the light of the other does, on the same side of the normal and on the other.
pub(crate) fn helmholtz(first: (&[Observation], f64), second: (&[Observation], f64)) -> Check {
    let name = "light and sensor swapped";
    let [a, b] = [first.1, second.1];
    let at = |(plane, theta_r): (&[Observation], f64), light: f64| {
        let readings = plane.iter().map(|o| (o.deviation, o.rgb)).collect();
        between(readings, light.sin() + theta_r.sin())
    };
    let pairs: Vec<(f64, DVec3, DVec3)> = [1.0, -1.0]
        .into_iter()
        .filter_map(|side| Some((side, at(first, side * b)?, at(second, side * a)?)))
        .collect();
    let degrees = [a, b].map(f64::to_degrees);
    let which = format!("The planes at {:.0}° and {:.0}°", degrees[0], degrees[1]);
    let worst = pairs
        .iter()
        .map(|(_, f, g)| {
            (2.0 * (*f - *g) / (*f + *g).max(DVec3::splat(f64::MIN_POSITIVE)))
                .abs()
                .max_element()
        })
        .reduce(f64::max);
    let values = json!({
        "theta_r_deg": degrees,
        "difference": worst,
        "pairs": pairs.iter().map(|(_, f, g)| [f.to_array(), g.to_array()]).collect::<Vec<_>>(),
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
        verdict: limit(worst, SIDES_LIMIT),
        text: format!(
            "{which} share {} poses with light and sensor swapped, interpolated between readings; they differ by {:.1} % at most (up to {:.0} % is good).",
            pairs.len(),
            100.0 * worst,
            100.0 * SIDES_LIMIT
        ),
        values,
    }
}

/// The two sides of a plane at the same d_p: what the model takes to be equal.
pub(crate) fn sides(plane: &[Observation], theta_r: f64) -> Check {
    let name = "both sides of the mirror direction";
    let side = |sign: f64| -> Vec<(f64, DVec3)> {
        let on_side = plane.iter().filter(|o| o.deviation * sign > 0.0);
        on_side.map(|o| (o.deviation.abs(), o.rgb)).collect()
    };
    let (inner, outer) = (side(1.0), side(-1.0));
    let mut differences: Vec<f64> = outer
        .iter()
        .filter_map(|(d_p, outwards)| {
            let inwards = between(inner.clone(), *d_p)?;
            let ratio = (*outwards / inwards).map(|r| r.max(f64::MIN_POSITIVE).ln().abs());
            ratio.is_finite().then(|| ratio.max_element())
        })
        .collect();
    differences.sort_by(f64::total_cmp);
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
    Check {
        name,
        verdict: limit(median, SIDES_LIMIT),
        text: format!(
            "At {degrees:.0}° the two sides of the mirror direction differ by {:.1} % in the median over {} readings; the model takes them to be equal.",
            100.0 * median.exp_m1(),
            differences.len()
        ),
        values: json!({ "theta_r_deg": degrees, "median_log_ratio": median, "readings": differences.len() }),
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
            "{n} more were taken with another exposure, {:.1} s of light",
            run.seconds.again
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

/// Nothing reflects more than it receives: directional albedo at a few angles, over so many azimuths about the mirror
/// direction; 1 is enough for a model that is constant along them.
pub(crate) fn energy(model: &dyn Brdf, azimuths: usize) -> Check {
    let albedos: Vec<(f64, DVec3)> = ALBEDO_DEG
        .map(|deg| (deg, albedo(model, deg.to_radians(), azimuths)))
        .into();
    let worst = albedos.iter().map(|(_, a)| a.max_element()).fold(0.0, f64::max);
    Check {
        name: "energy",
        verdict: if worst <= 1.0 {
            Verdict::Good
        } else {
            Verdict::Look
        },
        text: format!(
            "The directional albedo is at most {worst:.3} at {}°; above 1 the specimen would give off more light than it gets.",
            ALBEDO_DEG.map(|deg| deg.to_string()).join(", ")
        ),
        values: json!(
            albedos
                .iter()
                .map(|(deg, a)| json!({ "theta_deg": deg, "rgb": a.to_array() }))
                .collect::<Vec<_>>()
        ),
    }
}

/// How much of the BRDF rests on nothing that was measured, over pairs below 80°, even in angle, that the job asks for.
pub(crate) fn coverage(model: &dyn Model) -> Check {
    let zenith = || (0..80).step_by(4).map(|deg| f64::from(deg + 2).to_radians());
    let azimuth = || (0..180).step_by(10).map(|deg| f64::from(deg + 5).to_radians());
    let (mut pairs, mut beyond, mut hidden, mut outside) = (0_u32, 0_u32, 0_u32, 0_u32);
    for (theta_i, theta_o) in zenith().flat_map(|i| zenith().map(move |o| (i, o))) {
        let exitant = Spherical {
            theta: theta_o,
            phi: 0.0,
        }
        .direction();
        for phi in azimuth() {
            let incident = Spherical { theta: theta_i, phi }.direction();
            let basis = model.basis(incident, exitant);
            if basis == Basis::NotMeasured {
                outside += 1;
                continue;
            }
            pairs += 1;
            beyond += u32::from(basis == Basis::Extrapolated);
            hidden += u32::from(basis == Basis::Occluded);
        }
    }
    let [share, occluded] = [beyond, hidden].map(|count| f64::from(count) / f64::from(pairs.max(1)));
    let not_measured = f64::from(outside) / f64::from(pairs + outside);
    let of_scene = match outside {
        0 => String::new(),
        _ => format!(
            " The scene leaves {:.1} % out, which are not measured and not counted here.",
            100.0 * not_measured
        ),
    };
    Check {
        name: "coverage",
        verdict: limit(share + occluded, COVERAGE_LIMIT),
        text: format!(
            "{:.1} % of all pairs of directions below 80° lie beyond the range that was measured and are extrapolated, {:.1} % where the arms hide each other.{of_scene}",
            100.0 * share,
            100.0 * occluded
        ),
        values: json!({ "extrapolated": share, "occluded": occluded, "not_measured": not_measured }),
    }
}

fn limit(value: f64, limit: f64) -> Verdict {
    if value <= limit {
        Verdict::Good
    } else {
        Verdict::Look
    }
}

/// Value at `x` between the two nearest of `points`, linear in ln(1 + f); `None` outside of them.
fn between(mut points: Vec<(f64, DVec3)>, x: f64) -> Option<DVec3> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let at = points.partition_point(|point| point.0 < x);
    let &(x1, f1) = points.get(at)?;
    if x1 == x {
        return Some(f1);
    }
    let (x0, f0) = points[at.checked_sub(1)?];
    let t = (x - x0) / (x1 - x0);
    let log = |f: DVec3| f.map(f64::ln_1p);
    Some((log(f0) * (1.0 - t) + log(f1) * t).map(f64::exp_m1))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn more_light_out_than_in_is_noticed() {
        let verdict = |albedo| energy(&brdf::Lambert::new(albedo).unwrap(), 1).verdict;
        assert_eq!(verdict(0.9), Verdict::Good);
        struct Bright;
        impl Brdf for Bright {
            fn eval(&self, _: DVec3, _: DVec3) -> DVec3 {
                DVec3::splat(1.2 / PI)
            }
        }
        assert_eq!(energy(&Bright, 1).verdict, Verdict::Look);
    }

    #[test]
    fn light_and_sensor_may_be_swapped_in_a_reciprocal_specimen_only() {
        let plane = |theta_r: f64, factor: f64| -> Vec<Observation> {
            let material = brdf::Fitted::named("blue-rubber").unwrap();
            let at = |n: i32| Observation::of(&material, theta_r, f64::from(n) * 0.01);
            let read = (-99..199).filter_map(at);
            read.map(|o| Observation {
                rgb: o.rgb * factor,
                ..o
            })
            .collect()
        };
        let (first, good, bad) = (plane(0.3, 1.0), plane(0.8, 1.0), plane(0.8, 1.3));
        let check = helmholtz((&first, 0.3), (&good, 0.8));
        assert_eq!(check.verdict, Verdict::Good, "{}", check.text);
        assert_eq!(check.values["pairs"].as_array().unwrap().len(), 2);
        assert_eq!(helmholtz((&first, 0.3), (&bad, 0.8)).verdict, Verdict::Look);
        assert_eq!(
            helmholtz((&first, 0.3), (&bad[..1], 0.8)).verdict,
            Verdict::Unknown
        );
    }

    #[test]
    fn interpolation_is_exact_at_the_points_and_refuses_what_lies_outside() {
        let points = vec![(2.0, DVec3::splat(5.0)), (1.0, DVec3::splat(3.0))];
        assert_eq!(between(points.clone(), 1.0), Some(DVec3::splat(3.0)));
        assert_eq!(between(points.clone(), 2.0), Some(DVec3::splat(5.0)));
        assert_eq!(between(points.clone(), 0.5), None);
        assert_eq!(between(points.clone(), 2.5), None);
        let middle = between(points, 1.5).unwrap().x;
        assert!((middle - (24.0_f64.sqrt() - 1.0)).abs() < 1e-12, "{middle}");
    }
}
