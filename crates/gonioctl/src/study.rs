use std::path::{Path, PathBuf};
use std::sync::Mutex;

use ::study::Study;
use indicatif::{ProgressBar, ProgressStyle};

/// Runs a study into a directory, which is printed; what was found goes to stderr.
///
/// # Errors
/// The study file is wrong, or the results cannot be written.
pub(crate) fn study(
    file: Option<&Path>,
    on: &[PathBuf],
    every: usize,
    quick: bool,
    out: Option<PathBuf>,
) -> anyhow::Result<()> {
    let mut study = Study::read(file, quick)?;
    if !on.is_empty() {
        study = study.on(on, every)?;
    }
    let directory = out.unwrap_or_else(|| Path::new("studies").join(name(file, quick)));
    let style = ProgressStyle::with_template("[{bar:30}] {percent} %, {elapsed} taken, {eta} left")?;
    let bar = ProgressBar::new(0).with_style(style.progress_chars("=> "));
    let printed = Mutex::new(0);
    let found = study.run(&directory, &|done, of| {
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
    })?;
    bar.finish_and_clear();
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
