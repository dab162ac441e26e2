use std::io;
use std::path::Path;

use indicatif::{ProgressBar, ProgressStyle};

use crate::print;

/// Runs a study: rows to a directory or to stdout, the summary to stderr.
///
/// # Errors
/// The study file is wrong, or the results cannot be written.
pub(crate) fn study(file: Option<&Path>, quick: bool, out: Option<&Path>) -> anyhow::Result<()> {
    let style = ProgressStyle::with_template("[{bar:30}] {pos}/{len} materials, {eta} left")?;
    let bar = ProgressBar::new(0).with_style(style.progress_chars("=> "));
    let progress = |done: usize, of: usize| {
        bar.set_length(of as u64);
        bar.set_position(done as u64);
    };
    let summary = ::study::main_like(file, quick, out, io::stdout().lock(), progress)?;
    bar.finish_and_clear();
    print::say(summary);
    Ok(())
}
