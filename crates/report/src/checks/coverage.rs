use arms::Envelope;
use brdf::Spherical;
use pdv::{Basis, Model};
use serde_json::json;

use crate::{Check, Verdict};

/// So much may be extrapolated: a plane at 70° with ordinary limits leaves less out.
const LIMIT: f64 = 0.10;

/// How much of the BRDF rests on nothing that was measured, over pairs below 80°, even in angle, that the job asks for,
/// and why: because light and sensor would stand so close together that the arms hide each other, or because the job
/// asked for no reading there.
pub(crate) fn coverage(model: &dyn Model, envelope: &Envelope, has_arc: bool) -> Check {
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
            if basis == Basis::Extrapolated {
                let arms_meet = incident.angle_between(exitant) < envelope.separation_rad;
                hidden += u32::from(arms_meet);
                beyond += u32::from(!arms_meet);
            }
        }
    }
    let [share, occluded] = [beyond, hidden].map(|count| f64::from(count) / f64::from(pairs.max(1)));
    let not_measured = f64::from(outside) / f64::from((pairs + outside).max(1));
    let of_arc = match has_arc {
        true => "",
        false => ", among them what only a mirror arc could tell: the job has none",
    };
    let of_arms = match hidden {
        0 => String::new(),
        _ => format!(
            " {:.1} % lie where the arms hide each other, closer together than {:.1}°.",
            100.0 * occluded,
            envelope.separation_rad.to_degrees()
        ),
    };
    let of_scene = match outside {
        0 => String::new(),
        _ => format!(
            " The scene leaves {:.1} % out, which are not measured and not counted here.",
            100.0 * not_measured
        ),
    };
    Check {
        name: "coverage",
        verdict: match share + occluded <= LIMIT {
            true => Verdict::Good,
            false => Verdict::Look,
        },
        text: format!(
            "{:.1} % of all pairs of directions below 80° lie beyond the range of the job's sweeps and are extrapolated{of_arc}.{of_arms}{of_scene}",
            100.0 * share
        ),
        values: json!({ "extrapolated": share, "occluded": occluded, "not_measured": not_measured }),
    }
}
