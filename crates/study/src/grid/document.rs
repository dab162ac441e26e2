use std::path::Path;

use super::figures::figures;
use super::front::{FamilyLine, Line};
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
    write::file(directory, "families.csv", &families_csv(&summary.families)?)?;
    // The seconds of this machine stay in the ledgers: a study that is done again, or in shards, is the same files.
    let text = ledger::text_without(rows, "fit_s").map_err(Error::Write)?;
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
    page.heading("The plans of the front by family of materials");
    page.table(&family_table(&summary.families));
    page.heading("Log-relative PCA, learnt from all other families, its readings without noise");
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
        "motion",
        "rig s",
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
            line.approach.clone(),
            line.planes_deg.clone(),
            line.readings.to_string(),
            line.arc.to_string(),
            line.motion.clone(),
            number(line.rig_s, 1),
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
        "placed",
        "MALE mean",
        "median",
        "10 %",
        "90 %",
        "median rel. error",
        "front is below from",
    ];
    let mut rows = vec![heading.map(str::to_owned).to_vec()];
    for pca in pca {
        rows.push(vec![
            pca.readings.to_string(),
            pca.placed.to_owned(),
            format!("{:.5}", pca.male_mean),
            format!("{:.5}", pca.male_median),
            format!("{:.5}", pca.male_p10),
            format!("{:.5}", pca.male_p90),
            format!("{:.2} %", 100.0 * pca.median_rel),
            pca.beaten_from_s
                .map_or("nowhere".to_owned(), |s| format!("{s:.0} s")),
        ]);
    }
    rows
}

/// Columns of families.csv and of the table by family.
const BY_FAMILY: [&str; 11] = [
    "family",
    "materials",
    "model",
    "planes_deg",
    "readings",
    "arc",
    "male_mean",
    "male_median",
    "male_p10",
    "male_p90",
    "median_rel",
];

fn by_family(line: &FamilyLine) -> [String; 11] {
    let FamilyLine {
        family,
        materials,
        line,
    } = line;
    let error = |value: f64| format!("{value:.6}");
    [
        family.clone(),
        materials.to_string(),
        line.approach.clone(),
        line.planes_deg.clone(),
        line.readings.to_string(),
        line.arc.to_string(),
        error(line.male_mean),
        error(line.male_median),
        error(line.male_p10),
        error(line.male_p90),
        error(line.median_rel),
    ]
}

/// families.csv.
fn families_csv(lines: &[FamilyLine]) -> Result<Vec<u8>, Error> {
    let failed = |error: csv::Error| Error::Write(error.into());
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(BY_FAMILY).map_err(failed)?;
    for line in lines {
        writer.write_record(by_family(line)).map_err(failed)?;
    }
    writer
        .into_inner()
        .map_err(|error| Error::Write(std::io::Error::other(error.to_string())))
}

fn family_table(lines: &[FamilyLine]) -> Vec<Vec<String>> {
    let rows = lines.iter().map(|line| by_family(line).to_vec());
    std::iter::once(BY_FAMILY.map(str::to_owned).to_vec())
        .chain(rows)
        .collect()
}
