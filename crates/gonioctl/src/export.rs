use std::fs::File;
use std::io;
use std::path::Path;

use anyhow::Context;
use report::RunDirectory;

use crate::cli::Format;

/// Copies the result of a run in one format to a file, or to stdout.
///
/// # Errors
/// The run has no such result, as one that is not complete; the target cannot be written.
pub(crate) fn export(run: &Path, format: Format, to: Option<&Path>) -> anyhow::Result<()> {
    let name = match format {
        Format::Merl => "brdf.binary",
        Format::Exr => "slice.exr",
        Format::Csv => "readings.csv",
    };
    let path = RunDirectory::at(run).file(name);
    let mut source = File::open(&path).with_context(|| {
        format!(
            "cannot open {}; `gonioctl reconstruct` makes it of a complete run",
            path.display()
        )
    })?;
    match to {
        Some(to) => {
            let copied = File::create(to).and_then(|mut file| {
                io::copy(&mut source, &mut file)?;
                file.sync_all()
            });
            copied.with_context(|| format!("cannot write {}", to.display()))?;
        }
        None => {
            io::copy(&mut source, &mut io::stdout().lock()).context("cannot write to stdout")?;
        }
    }
    Ok(())
}
