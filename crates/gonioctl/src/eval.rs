use std::path::Path;
use std::sync::Arc;

use brdf::{Brdf, MerlTable};
use pdv::{Draw, compare};
use serde_json::Value;

/// Compares two BRDFs by every metric.
///
/// # Errors
/// A text that names no BRDF, or a file that is no MERL table.
pub(crate) fn eval(truth: &str, estimate: &str, as_json: bool) -> anyhow::Result<()> {
    let (truth, estimate) = (load(truth)?, load(estimate)?);
    let comparison = compare(&truth, &[&estimate], &Draw::default()).remove(0);
    let comparison = serde_json::to_value(comparison)?;
    if as_json {
        terminal::json(&comparison)?;
    } else {
        for line in lines(&comparison) {
            terminal::line(line)?;
        }
    }
    Ok(())
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
    const ROWS: [&str; 7] = [
        "male",
        "median_rel",
        "p95_rel",
        "rel_rms",
        "log_rel_rmse",
        "eq4",
        "eq4_black",
    ];
    let channels = &comparison["channels"];
    let columns = [comparison, &channels["r"], &channels["g"], &channels["b"]];
    let mut lines = vec![format!(
        "{:<13}{:>11}{:>11}{:>11}{:>11}",
        "", "all", "red", "green", "blue"
    )];
    for name in ROWS {
        let cell = |value: f64| format!("{value:.6}");
        let cells = columns.map(|column| column[name].as_f64().map_or_else(|| "-".to_owned(), cell));
        let [all, red, green, blue] = cells;
        lines.push(format!("{name:<13}{all:>11}{red:>11}{green:>11}{blue:>11}"));
    }
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    lines.push(format!(
        "over {} pairs below {:.0}°, {:.1} % of those drawn left out",
        comparison["pairs"],
        number(&comparison["draw"]["theta_max"]).to_degrees(),
        100.0 * number(&comparison["left_out"])
    ));
    lines
}
