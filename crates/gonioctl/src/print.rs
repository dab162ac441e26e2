use std::io::{self, Write};

use serde::Serialize;

/// Prints a line of data on stdout. A reader that went away (`| head`) is no error of ours.
///
/// # Errors
/// Stdout refuses for another reason, such as a full disk behind a redirection.
pub(crate) fn line(text: impl std::fmt::Display) -> io::Result<()> {
    gone_is_fine(writeln!(io::stdout(), "{text}"))
}

/// Prints a value as indented JSON on stdout.
///
/// # Errors
/// As [`line()`].
pub(crate) fn json(value: &impl Serialize) -> io::Result<()> {
    line(serde_json::to_string_pretty(value)?)
}

/// Says something on stderr. There is nobody to tell where stderr is gone.
pub(crate) fn say(text: impl std::fmt::Display) {
    let _ = writeln!(io::stderr(), "{text}");
}

fn gone_is_fine(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}
