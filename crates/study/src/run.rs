use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use brdf::Brdf;

use crate::{Error, Row, Study, Summary};

/// Runs a study: one CSV row for each material and angle goes to `out` as it is ready; `progress` is told the
/// materials done and their number.
///
/// The pairs are drawn and the material evaluated once for all angles; one material at a time, on all cores.
///
/// # Errors
/// `out` refuses, or a material cannot be reconstructed.
pub fn run(
    study: &Study,
    mut out: impl Write,
    mut progress: impl FnMut(usize, usize),
) -> Result<Summary, Error> {
    writeln!(out, "{}", Row::HEADING)?;
    let mut rows = Vec::new();
    for (done, material) in study.materials.iter().enumerate() {
        progress(done, study.materials.len());
        let models = study.reconstruct(material)?;
        let estimates: Vec<&dyn Brdf> = models.iter().map(|model| model as &dyn Brdf).collect();
        for (theta_r, found) in
            study
                .theta_r
                .iter()
                .zip(pdv::compare(&material.brdf, &estimates, &study.draw))
        {
            let row = Row {
                material: material.name.clone(),
                theta_r_deg: theta_r.to_degrees(),
                metrics: found.overall,
            };
            row.write(&mut out)?;
            rows.push(row);
        }
    }
    progress(study.materials.len(), study.materials.len());
    out.flush()?;
    Ok(Summary::new(&rows))
}

/// What `gonioctl study` does: reads the study file (`None`: the paper's evaluation, built in), with `quick` on a
/// hundredth of the pairs, and runs it.
///
/// With `directory`, which is made where it is missing, the rows go to `study.csv` and the summary to `summary.json`
/// in it; without, the rows go to `out`.
///
/// # Errors
/// The study file is wrong, a file cannot be written, or a material cannot be reconstructed.
pub fn main_like(
    file: Option<&Path>,
    quick: bool,
    directory: Option<&Path>,
    out: impl Write,
    progress: impl FnMut(usize, usize),
) -> Result<Summary, Error> {
    let study = match file {
        Some(file) => Study::read(file)?,
        None => Study::parse(
            include_str!("../../../config/studies/paper.toml"),
            "the built-in study",
        )?,
    };
    let study = if quick { study.quick() } else { study };
    let Some(directory) = directory else {
        return run(&study, out, progress);
    };
    let write = |path: &Path, source| Error::Io {
        what: "write",
        path: path.to_owned(),
        source,
    };
    std::fs::create_dir_all(directory).map_err(|source| write(directory, source))?;
    let (rows, json) = (directory.join("study.csv"), directory.join("summary.json"));
    let csv = File::create(&rows).map_err(|source| write(&rows, source))?;
    let summary = run(&study, BufWriter::new(csv), progress)?;
    let text = serde_json::to_string_pretty(&summary).map_err(|error| write(&json, error.into()))?;
    std::fs::write(&json, text).map_err(|source| write(&json, source))?;
    Ok(summary)
}
