use std::path::{Path, PathBuf};
use std::sync::Mutex;

use ::study::{Shard, Study};
use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::StudyArguments;

/// Runs a study, or one part of it, into a directory, which is printed; what was found goes to stderr.
///
/// # Errors
/// The study file is wrong, or the results cannot be written.
pub(crate) fn study(arguments: &StudyArguments, shard: Option<Shard>) -> anyhow::Result<()> {
    let (study, directory) = opened(arguments)?;
    let style = ProgressStyle::with_template("[{bar:30}] {percent} %, {elapsed} taken, {eta} left")?;
    let bar = ProgressBar::new(0).with_style(style.progress_chars("=> "));
    let printed = Mutex::new(0);
    let progress = |done, of: u64| {
        bar.set_length(of);
        bar.set_position(done);
        // Without a terminal, a line for every tenth.
        let tenth = 10 * done / of.max(1);
        let mut printed = printed.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if bar.is_hidden() && tenth > *printed {
            *printed = tenth;
            let left = bar.eta().as_secs();
            terminal::say(format_args!("{} %, {left} s left", 10 * tenth));
        }
    };
    let found = match shard {
        Some(shard) => study.run_shard(&directory, shard, &progress)?,
        None => study.run(&directory, &progress)?,
    };
    bar.finish_and_clear();
    tell(&found, &directory)
}

/// Makes a study of what its shards did in a directory, which is printed; what was found goes to stderr.
///
/// # Errors
/// The study file is wrong, something is not done yet, or the results cannot be written.
pub(crate) fn merge(arguments: &StudyArguments) -> anyhow::Result<()> {
    let (study, directory) = opened(arguments)?;
    let found = study.merge(&directory)?;
    tell(&found, &directory)
}

/// The study that arguments name, and its directory.
fn opened(arguments: &StudyArguments) -> anyhow::Result<(Study, PathBuf)> {
    let StudyArguments {
        study: file,
        on,
        every,
        quick,
        out,
    } = arguments;
    let file = file.as_deref();
    let mut study = Study::read(file, *quick)?;
    if !on.is_empty() {
        study = study.on(on, *every)?;
    }
    let directory = out.clone();
    let directory = directory.unwrap_or_else(|| Path::new("studies").join(name(file, *quick)));
    Ok((study, directory))
}

fn tell(found: &str, directory: &Path) -> anyhow::Result<()> {
    for line in found.lines() {
        terminal::say(line);
    }
    terminal::line(directory.display())?;
    Ok(())
}

/// Of the directory, where none is named.
fn name(file: Option<&Path>, quick: bool) -> String {
    let stem = file.and_then(Path::file_stem).map(|stem| stem.to_string_lossy());
    let stem = stem.unwrap_or("error-against-time".into());
    if quick {
        format!("{stem}-quick")
    } else {
        stem.into_owned()
    }
}
