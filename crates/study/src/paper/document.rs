use std::path::Path;

use super::{Evaluation, Row, Summary, figures, spheres};
use crate::page::Page;
use crate::{Error, ledger, write};

/// Writes everything that follows from the rows, and says what was found.
pub(crate) fn write(evaluation: &Evaluation, rows: &[Row], directory: &Path) -> Result<String, Error> {
    let summary = Summary::new(rows);
    let text = ledger::text(rows, true).map_err(Error::Write)?;
    write::file(directory, "study.csv", &text)?;
    let json = serde_json::to_vec_pretty(&summary).map_err(|error| Error::Write(error.into()))?;
    write::file(directory, "summary.json", &json)?;
    let words = summary.to_string();
    let mut page = Page::new("The paper's evaluation");
    page.text(&words);
    for (name, figure) in figures::all(evaluation, rows)? {
        let svg = figure.svg()?;
        write::file(directory, &format!("{name}.svg"), svg.as_bytes())?;
        write::file(directory, &format!("{name}.png"), &figure.png()?)?;
        page.figure(&svg, &figure.title);
    }
    page.heading(&format!(
        "Figure 8: reference, reconstruction at {:.0}°, difference in luminance",
        evaluation.shown.to_degrees()
    ));
    let sheet = spheres::write(evaluation, directory)?;
    page.image(&sheet, "Lit spheres of six materials");
    write::file(directory, "index.html", page.html().as_bytes())?;
    Ok(words)
}
