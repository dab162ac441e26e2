use std::path::Path;

use super::figures::figures;
use super::front::Line;
use super::outcome::Outcome;
use super::summary::{Pca, Summary};
use super::words::words;
use super::{Grid, GridRow};
use crate::page::Page;
use crate::{Error, ledger, write};

/// Writes everything that follows from the rows of a grid, and says what it found.
pub(crate) fn write(grid: &Grid, rows: &[GridRow], directory: &Path) -> Result<String, Error> {
    let outcome = Outcome::new(rows);
    let summary = Summary::new(grid, &outcome);
    let csv = |name: &str, lines: &[Line]| -> Result<(), Error> {
        let text = ledger::text(lines, true).map_err(Error::Write)?;
        write::file(directory, name, &text)
    };
    let text = ledger::text(rows, true).map_err(Error::Write)?;
    write::file(directory, "study.csv", &text)?;
    csv("front.csv", &outcome.lines())?;
    csv("floor.csv", &summary.floors)?;
    let json = serde_json::to_vec_pretty(&summary).map_err(|error| Error::Write(error.into()))?;
    write::file(directory, "summary.json", &json)?;
    let mut page = Page::new("Error against run time");
    let words = words(&outcome, &summary);
    page.text(&words);
    for (name, figure) in figures(&outcome, &summary) {
        let svg = figure.svg()?;
        write::file(directory, &format!("{name}.svg"), svg.as_bytes())?;
        write::file(directory, &format!("{name}.png"), &figure.png()?)?;
        page.figure(&svg, &figure.title);
    }
    page.heading("The front: what no other plan reaches in less time");
    page.table(&table(&summary.front));
    page.heading("Floors: the same models from 360 + 360 readings of a perfect instrument");
    page.table(&table(&summary.floors));
    page.heading("Log-relative PCA, readings anywhere on the hemisphere, without noise");
    page.table(&pca_table(&summary.pca));
    write::file(directory, "index.html", page.html().as_bytes())?;
    Ok(words)
}

fn table(lines: &[Line]) -> Vec<Vec<String>> {
    let heading = [
        "model",
        "planes in °",
        "readings each",
        "arc",
        "rig s",
        "compute s",
        "MALE mean",
        "median",
        "10 %",
        "90 %",
        "median rel. error",
    ];
    let mut rows = vec![heading.map(str::to_owned).to_vec()];
    for line in lines {
        let number = |value: f64, digits: usize| match value.is_finite() {
            true => format!("{value:.digits$}"),
            false => "–".to_owned(),
        };
        rows.push(vec![
            line.family.clone(),
            line.planes_deg.clone(),
            line.readings.to_string(),
            line.arc.to_string(),
            number(line.rig_s, 1),
            number(line.fit_s, 3),
            number(line.male_mean, 5),
            number(line.male_median, 5),
            number(line.male_p10, 5),
            number(line.male_p90, 5),
            format!("{:.2} %", 100.0 * line.median_rel),
        ]);
    }
    rows
}

fn pca_table(pca: &[Pca]) -> Vec<Vec<String>> {
    let heading = [
        "readings",
        "MALE mean",
        "median",
        "median rel. error",
        "front is below from",
    ];
    let mut rows = vec![heading.map(str::to_owned).to_vec()];
    for pca in pca {
        rows.push(vec![
            pca.readings.to_string(),
            format!("{:.5}", pca.male_mean),
            format!("{:.5}", pca.male_median),
            format!("{:.2} %", 100.0 * pca.median_rel),
            pca.beaten_from_s
                .map_or("nowhere".to_owned(), |s| format!("{s:.0} s")),
        ]);
    }
    rows
}
