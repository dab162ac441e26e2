use serde_json::json;

use crate::run::Run;
use crate::{Check, Verdict};

/// Retries and flags.
pub(crate) fn bus(run: &Run) -> Check {
    let flagged: Vec<String> = run.flags.iter().map(|(flag, n)| format!("{n} {flag}")).collect();
    let dim_or_saturated = ["saturated", "dim"]
        .iter()
        .any(|flag| run.flags.contains_key(flag));
    let flags = if flagged.is_empty() {
        "none carries a flag".to_owned()
    } else {
        flagged.join(", ")
    };
    Check {
        name: "readings",
        verdict: if dim_or_saturated {
            Verdict::Look
        } else {
            Verdict::Good
        },
        text: format!(
            "{} readings for {} steps; {flags}; {} requests on the bus were repeated.",
            run.readings.taken, run.readings.accepted, run.retries
        ),
        values: json!({ "taken": run.readings.taken, "accepted": run.readings.accepted, "retries": run.retries, "flags": run.flags }),
    }
}
