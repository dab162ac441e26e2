use capture::Record;
use rig::{Lamp, Reduction, RigFile, Taken};
use serde_json::json;
use sweep::Sweep;

use crate::measurement::{all_taken, believed, certificate};
use crate::{Check, Verdict};

/// By how much the lamp may change between two visits to the reference pose until somebody should look, and until nothing that
/// was measured between them can be believed: it is taken to drift evenly there.
const STEPS: [f64; 2] = [0.05, 0.3];

/// Whether the visits to the reference pose, which follow the lamp, agree with each other; `None` where a monitor does that.
pub(crate) fn visits(records: &[Record], rig: &RigFile) -> Option<Check> {
    if rig.visits.lamp != Lamp::Visits {
        return None;
    }
    let readings = all_taken(records);
    let made: Vec<Taken> = readings
        .iter()
        .filter(|(reading, _)| reading.sweep == Sweep::Reference && reading.accepted)
        .map(|(_, taken)| *taken)
        .collect();
    let levels = Reduction::new(rig, certificate(records), &believed(&readings), &made).lamp_levels();
    let step = levels
        .windows(2)
        .map(|pair| (pair[1] / pair[0]).max(pair[0] / pair[1]) - 1.0)
        .fold(0.0, f64::max);
    let unusable = made.len() - levels.len();
    let (verdict, text) = match (levels.is_empty(), unusable, step) {
        (true, ..) => (
            Verdict::Bad,
            "No visit to the reference pose tells anything, so nobody knows what the lamp gave.".to_owned(),
        ),
        (_, _, step) if step > STEPS[1] => (
            Verdict::Bad,
            format!(
                "The lamp changed by {:.0} % from one visit to the reference pose to the next: what was measured between them \
                 is worth nothing. Look at the lamp and for light from outside, and measure again.",
                100.0 * step
            ),
        ),
        (_, 1.., _) => (
            Verdict::Look,
            format!(
                "{unusable} of {} visits to the reference pose tell nothing; the others follow the lamp.",
                made.len()
            ),
        ),
        (_, _, step) => (
            if step > STEPS[0] {
                Verdict::Look
            } else {
                Verdict::Good
            },
            format!(
                "The lamp changed by at most {:.1} % from one visit to the reference pose to the next.",
                100.0 * step
            ),
        ),
    };
    Some(Check {
        name: "reference visits",
        verdict,
        text,
        values: json!({ "levels": levels, "unusable": unusable }),
    })
}
