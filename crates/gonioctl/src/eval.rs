use std::path::Path;
use std::sync::Arc;

use brdf::{Brdf, MerlTable};
use pdv::{Comparison, Draw, Metrics, compare};

use crate::print;

/// Compares two BRDFs by every metric.
///
/// # Errors
/// A text that names no BRDF, or a file that is no MERL table.
pub(crate) fn eval(truth: &str, estimate: &str, as_json: bool) -> anyhow::Result<()> {
    let (truth, estimate) = (load(truth)?, load(estimate)?);
    let comparison = compare(&truth, &[&estimate], &Draw::default()).remove(0);
    if as_json {
        print::json(&comparison)?;
    } else {
        for line in lines(&comparison) {
            print::line(line)?;
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

/// A comparison for people: one metric a line, all channels together and each by itself.
pub(crate) fn lines(comparison: &Comparison) -> Vec<String> {
    type Pick = fn(&Metrics) -> Option<f64>;
    const ROWS: [(&str, Pick); 7] = [
        ("male", |m| m.male),
        ("median_rel", |m| m.median_rel),
        ("p95_rel", |m| m.p95_rel),
        ("rel_rms", |m| m.rel_rms),
        ("log_rel_rmse", |m| m.log_rel_rmse),
        ("eq4", |m| m.eq4),
        ("eq4_black", |m| m.eq4_black),
    ];
    let channels = &comparison.channels;
    let columns = [&comparison.overall, &channels.r, &channels.g, &channels.b];
    let mut lines = vec![format!(
        "{:<13}{:>11}{:>11}{:>11}{:>11}",
        "", "all", "red", "green", "blue"
    )];
    for (name, pick) in ROWS {
        let cells = columns.map(|m| pick(m).map_or_else(|| "-".to_owned(), |v| format!("{v:.6}")));
        let [all, red, green, blue] = cells;
        lines.push(format!("{name:<13}{all:>11}{red:>11}{green:>11}{blue:>11}"));
    }
    let overall = &comparison.overall;
    lines.push(format!(
        "over {} pairs below {:.0}°, {:.1} % of those drawn left out",
        overall.pairs,
        comparison.draw.theta_max.to_degrees(),
        100.0 * overall.left_out
    ));
    lines
}
