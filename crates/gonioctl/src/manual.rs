use std::io::{self, Write};
use std::path::Path;

use anyhow::Context;
use clap::CommandFactory;
use clap_complete::Shell;

use crate::cli::Cli;

/// Name under which the program is installed.
const NAME: &str = "gonioctl";

/// The daemon's manual page; a test of goniod keeps it as its command line is.
const GONIOD: &str = include_str!("../../goniod/goniod.1");

/// Prints the script with which a shell completes commands and options.
///
/// # Errors
/// Stdout refuses.
pub(crate) fn completions(shell: Shell) -> anyhow::Result<()> {
    // Into memory first: the generator panics where a reader went away.
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), NAME, &mut script);
    match io::stdout().write_all(&script) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// Writes the manual pages, one for each command and one for the daemon, into a directory that is made where there is none.
///
/// # Errors
/// The directory cannot be made or written.
pub(crate) fn man(directory: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(directory)
        .and_then(|()| clap_mangen::generate_to(Cli::command(), directory))
        .and_then(|()| std::fs::write(directory.join("goniod.1"), GONIOD))
        .with_context(|| format!("cannot write manual pages into {}", directory.display()))
}
