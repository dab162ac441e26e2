use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use brdf::{Brdf, MerlTable};
use pdv::{Draw, compare};
use serde_json::{Value, json};
use session::Status;

use crate::bound::{Bound, Bounded};
use crate::document;
use crate::exit;
use crate::junit::{Case, Junit, Outcome};

/// The metrics, in the order of the table: keys of a comparison's JSON.
pub(crate) const METRICS: [&str; 7] = [
    "male",
    "median_rel",
    "p95_rel",
    "rel_rms",
    "log_rel_rmse",
    "eq4",
    "eq4_black",
];
/// Width of a column of the table of metrics, characters: that of 0.000000 and a digit more.
const LEAST_WIDTH: usize = 9;
/// Blanks between two columns, characters.
const GAP: usize = 2;

/// Compares two BRDFs by every metric. The exit code is 1 where one is above its bound.
///
/// # Errors
/// A text that names no BRDF, or a file that is no MERL table; a file that cannot be written.
pub(crate) fn eval(
    truth: &str,
    estimate: &str,
    bounds: &[Bound],
    junit: Option<&Junit>,
    as_json: bool,
) -> anyhow::Result<ExitCode> {
    let (truth, estimate) = (load(truth)?, load(estimate)?);
    let comparison = compare(&truth, &[&estimate], &Draw::default()).remove(0);
    let mut comparison = serde_json::to_value(comparison)?;
    let bounded = |&bound: &Bound| Bounded::new(bound, &comparison);
    let bounded: Vec<Bounded> = bounds.iter().map(bounded).collect();
    if let Some(junit) = junit {
        junit.write(&cases(&comparison, &bounded))?;
    }
    if as_json {
        comparison["bounds"] = json!(bounded);
        document::METRICS.print(&comparison)?;
    } else {
        for line in lines(&comparison) {
            terminal::line(line)?;
        }
    }
    let mut status = Status::Done;
    for above in bounded.iter().filter(|bounded| bounded.above) {
        terminal::say(above);
        status = Status::Above;
    }
    Ok(exit::code(status))
}

/// Each bound as a test; and each metric without one, which passes.
fn cases(comparison: &Value, bounded: &[Bounded]) -> Vec<Case> {
    let free = |metric: &&str| bounded.iter().all(|bounded| bounded.metric != *metric);
    let free = METRICS.into_iter().filter(free).map(|metric| {
        let value = &comparison[metric];
        Case::new(metric, Outcome::Passed).saying(format!("{metric} is {value}, and has no bound"))
    });
    let bounded = bounded.iter().map(|bounded| {
        let name = format!("{} is at most {}", bounded.metric, bounded.at_most);
        match bounded.above {
            true => Case::new(name, Outcome::Failed(bounded.to_string())),
            false => Case::new(name, Outcome::Passed).saying(bounded.to_string()),
        }
    });
    bounded.chain(free).collect()
}

/// A file if there is one of that name, else what the text names.
fn load(text: &str) -> Result<Arc<dyn Brdf>, brdf::Error> {
    let path = Path::new(text);
    if path.is_file() {
        return Ok(Arc::new(MerlTable::read(path)?));
    }
    brdf::specimen(text)
}

/// A comparison, as its JSON has it, for people: one metric a line, all channels together and each by itself.
pub(crate) fn lines(comparison: &Value) -> Vec<String> {
    let channels = &comparison["channels"];
    let columns = [comparison, &channels["r"], &channels["g"], &channels["b"]];
    let heads = ["all", "red", "green", "blue"].map(str::to_owned);
    let cell = |value: f64| format!("{value:.6}");
    let cells = |name| columns.map(|column| column[name].as_f64().map_or_else(|| "-".to_owned(), cell));
    let rows: Vec<_> = METRICS.into_iter().map(|name| (name, cells(name))).collect();
    // A gap before each column, however many digits its numbers have.
    let widths: [usize; 4] = std::array::from_fn(|column| {
        let longest = rows.iter().map(|(_, cells)| cells[column].len()).max();
        longest.unwrap_or_default().max(LEAST_WIDTH) + GAP
    });
    let line = |name: &str, cells: &[String; 4]| {
        let cells = cells.iter().zip(widths);
        let cells: String = cells.map(|(cell, width)| format!("{cell:>width$}")).collect();
        format!("{name:<12}{cells}")
    };
    let mut lines = vec![line("", &heads)];
    lines.extend(rows.iter().map(|(name, cells)| line(name, cells)));
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    lines.push(format!(
        "over {} pairs below {:.0}°, {:.1} % of those drawn left out",
        comparison["pairs"],
        number(&comparison["draw"]["theta_max"]).to_degrees(),
        100.0 * number(&comparison["left_out"])
    ));
    lines
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::json;

    use super::*;

    proptest! {
        #[test]
        fn prop_numbers_of_any_size_stand_apart(all in -1e12..1e12f64, red in 0.0..1e300f64, green in 0.0..1.0f64) {
            let metrics = |value: f64| json!({
                "male": value, "median_rel": value, "p95_rel": value, "rel_rms": value,
                "log_rel_rmse": value, "eq4": value, "eq4_black": value
            });
            let mut comparison = metrics(all);
            comparison["channels"] = json!({ "r": metrics(red), "g": metrics(green), "b": null });
            let lines = lines(&comparison);
            let lengths: Vec<_> = lines[..8].iter().map(|line| line.chars().count()).collect();
            prop_assert!(lengths.iter().all(|&length| length == lengths[0]), "{lines:?}");
            for line in &lines[1..8] {
                let cells: Vec<_> = line.split_whitespace().collect();
                let expected = [format!("{all:.6}"), format!("{red:.6}"), format!("{green:.6}"), "-".to_owned()];
                prop_assert_eq!(&cells[1..], &expected[..]);
            }
        }
    }

    #[test]
    fn an_error_of_1000_percent_does_not_run_into_its_neighbour() {
        let row = json!({ "p95_rel": 1234.5678 });
        let mut comparison = row.clone();
        comparison["channels"] = json!({ "r": row, "g": row, "b": row });
        let line = &lines(&comparison)[3];
        assert_eq!(line.split_whitespace().count(), 5, "{line}");
    }
}
