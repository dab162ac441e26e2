use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use formats::{Export, FORMATS, Format};
use report::RunDirectory;

use crate::rebuilt::Rebuilt;

/// The readings of a run, which are no BRDF and so no format of `formats`.
pub(crate) const READINGS: &str = "csv";
/// What lists all formats instead of writing one.
pub(crate) const LIST: &str = "list";

/// Every word that `--format` takes.
pub(crate) fn words() -> impl Iterator<Item = &'static str> {
    [LIST, READINGS]
        .into_iter()
        .chain(FORMATS.iter().map(|format| format.name))
}

/// Writes the result of a run in one format to a file, or to stdout; or prints the list of formats.
///
/// What the run directory holds in that format is copied. Else the run's model is rebuilt from its readings, and the
/// figures of what was written go to stderr.
///
/// # Errors
/// No run is named; it is not complete; the format does not hold its result; the target cannot be written.
pub(crate) fn export(run: Option<&Path>, format: &str, to: Option<&Path>) -> anyhow::Result<()> {
    if format == LIST {
        return list();
    }
    let run = run.context("the run directory is missing: gonioctl export RUN_DIR --format NAME")?;
    let directory = RunDirectory::at(run);
    let kept = match format {
        READINGS => Some("readings.csv"),
        "merl" => Some("brdf.binary"),
        "exr" => Some("slice.exr"),
        _ => None,
    };
    let kept = kept.map(|name| directory.file(name));
    if let Some(path) = kept.filter(|path| format == READINGS || path.exists()) {
        return copy(&path, to);
    }
    let rebuilt = Rebuilt::from_journal(&directory)?;
    write(Format::named(format)?, &rebuilt.export(), to)
}

/// Writes a BRDF in a format to a file, or to stdout; the figures go to stderr.
///
/// # Errors
/// The format does not hold it; the target cannot be written.
pub(crate) fn write(format: &Format, export: &Export<'_>, to: Option<&Path>) -> anyhow::Result<()> {
    let exported = format.export(export)?;
    put(to, |out| out.write_all(&exported.bytes))?;
    terminal::say(format_args!("{}: {}", format.name, exported.fidelity));
    Ok(())
}

fn list() -> anyhow::Result<()> {
    terminal::line(
        "csv (.csv): The readings of the run, one row each, as readings.csv has them. Nothing is lost but the BRDF.",
    )?;
    for format in &FORMATS {
        terminal::line(format_args!(
            "{} (.{}): {}",
            format.name, format.extension, format.about
        ))?;
    }
    Ok(())
}

fn copy(path: &Path, to: Option<&Path>) -> anyhow::Result<()> {
    let mut source = File::open(path).with_context(|| {
        format!(
            "cannot open {}; `gonioctl reconstruct` makes it of a complete run",
            path.display()
        )
    })?;
    put(to, |mut out| io::copy(&mut source, &mut out).map(drop))
}

/// Fills a file, which appears under its name only when it is whole, or stdout.
fn put(to: Option<&Path>, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> anyhow::Result<()> {
    let Some(to) = to else {
        return fill(&mut io::stdout().lock()).context("cannot write to stdout");
    };
    // A pipe or a device is written to, not replaced.
    let special = to.metadata().is_ok_and(|metadata| !metadata.is_file());
    let partial = match special {
        true => to.to_owned(),
        false => PathBuf::from(format!("{}.partial", to.display())),
    };
    let attempt = || -> io::Result<()> {
        let mut file = File::create(&partial)?;
        fill(&mut file)?;
        if special {
            return Ok(());
        }
        file.sync_all()?;
        std::fs::rename(&partial, to)
    };
    attempt()
        .inspect_err(|_| {
            if !special {
                // The cause is worth more than a failure to clear up behind it.
                let _ = std::fs::remove_file(&partial);
            }
        })
        .with_context(|| format!("cannot write {}", to.display()))
}
