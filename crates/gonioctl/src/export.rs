use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use formats::{Export, FORMATS, Format};
use report::RunExport;

use crate::cli::DaemonArguments;
use crate::run_files::RunFiles;
use crate::wedge::{Wedge, correct};

/// The readings of a run, which are no BRDF and so no format of `formats`.
const READINGS: &str = "csv";
/// What stands for everything in one archive.
const ALL: &str = "all";
/// What lists all formats instead of writing one.
const LIST: &str = "list";

/// Every word that `--format` takes.
pub(crate) fn words() -> impl Iterator<Item = &'static str> {
    [LIST, ALL, READINGS]
        .into_iter()
        .chain(FORMATS.iter().map(|format| format.name))
}

/// Writes the result of a run in one format to a file, or to stdout; or prints the list of formats.
///
/// What the run directory holds in that format is copied. Else the run's model is rebuilt from its readings, and corrected
/// by those on wedges; the figures of what was written go to stderr.
///
/// # Errors
/// No run is named, or there is none; it is not complete; the format does not hold its result; the target cannot be
/// written.
pub(crate) fn export(
    run: Option<&str>,
    daemon: &DaemonArguments,
    format: &str,
    to: Option<&Path>,
    wedges: &[Wedge],
) -> anyhow::Result<()> {
    if format == LIST {
        return list();
    }
    anyhow::ensure!(
        format != READINGS || wedges.is_empty(),
        "--wedge corrects the BRDF, and \"{READINGS}\" has the readings alone; name another format"
    );
    let run = run.context("the run is missing: gonioctl export RUN --format NAME")?;
    let files = RunFiles::find(run, daemon)?;
    let to = target(&files, format, to)?;
    let to = to.as_deref();
    let kept = match format {
        READINGS => Some("readings.csv"),
        "merl" => Some("brdf.binary"),
        "exr" => Some("slice.exr"),
        _ => None,
    }
    .filter(|_| wedges.is_empty());
    let found = kept.map(|name| files.open(name)).transpose()?.flatten();
    if let Some(mut found) = found {
        return put(to, |mut out| io::copy(&mut found, &mut out).map(drop));
    }
    anyhow::ensure!(
        format != READINGS,
        "this run has no readings.csv; `gonioctl reconstruct` makes it of its journal"
    );
    let result = correct(RunExport::from_records(&files.records()?)?, wedges, daemon)?;
    if format == ALL {
        return put(to, |out| result.archive(out));
    }
    write(Format::named(format)?, &result.export(), to)
}

/// The file that is written: in a directory one that is named for the run and the format, which is told.
fn target(files: &RunFiles, format: &str, to: Option<&Path>) -> anyhow::Result<Option<PathBuf>> {
    let Some(directory) = to.filter(|to| to.is_dir()) else {
        return Ok(to.map(Path::to_owned));
    };
    let result = RunExport::from_records(&files.records()?)?;
    let name = match format {
        READINGS => result.name_of("readings", "csv"),
        ALL => result.name_of(ALL, "zip"),
        name => result.file_name(Format::named(name)?),
    };
    let path = directory.join(name);
    terminal::say(format_args!("writes {}", path.display()));
    Ok(Some(path))
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
    terminal::line(
        "all (.zip): Archive of the readings and of every format that holds the result, with the figures of each.",
    )?;
    for format in &FORMATS {
        terminal::line(format_args!(
            "{} (.{}): {}",
            format.name, format.extension, format.about
        ))?;
    }
    Ok(())
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
