use std::path::Path;

use super::compare::{Case, compare};
use super::{Evaluation, Row, Summary, document};
use crate::{Error, Progress};

/// Runs an evaluation into a directory: study.csv, summary.json, the figures and a page. Returns the summary in words.
///
/// # Errors
/// A material cannot be reconstructed, or the directory not be written.
pub(crate) fn run(
    evaluation: &Evaluation,
    directory: &Path,
    progress: &Progress<'_>,
) -> Result<String, Error> {
    let rows = evaluation.rows(progress)?;
    document::write(evaluation, &rows, directory)
}

impl Evaluation {
    /// One row for each material and angle, materials in their order.
    ///
    /// # Errors
    /// A material cannot be reconstructed.
    pub fn rows(&self, progress: &Progress<'_>) -> Result<Vec<Row>, Error> {
        let cases = self.materials.iter().map(|material| {
            Ok(Case {
                material,
                models: self.reconstruct(material)?,
            })
        });
        let cases = cases.collect::<Result<Vec<_>, Error>>()?;
        Ok(compare(&cases, &self.draw, progress)
            .into_iter()
            .flatten()
            .collect())
    }

    /// The summary of rows.
    pub fn summary(rows: &[Row]) -> Summary {
        Summary::new(rows)
    }
}
