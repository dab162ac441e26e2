use std::fmt::Display;
use std::io::{self, Write};

use serde::Serialize;

use crate::printable::{Printable, printable_json};

/// Prints a line of data on stdout, as [`Printable`] shows it. A reader that went away (`| head`) is no error.
///
/// # Errors
/// Stdout refuses for another reason, such as a full disk behind a redirection.
pub fn line(text: impl Display) -> io::Result<()> {
    put(Printable(text))
}

/// Prints a value as indented JSON on stdout.
///
/// # Errors
/// As [`line()`].
pub fn json(value: &impl Serialize) -> io::Result<()> {
    put(printable_json(&serde_json::to_string_pretty(value)?))
}

/// Prints a value as JSON in one line on stdout.
///
/// # Errors
/// As [`line()`].
pub fn json_line(value: &impl Serialize) -> io::Result<()> {
    put(printable_json(&serde_json::to_string(value)?))
}

/// Says something in a line on stderr, as [`Printable`] shows it. Where stderr is gone, nobody is left to say it to.
pub fn say(text: impl Display) {
    let _ = writeln!(io::stderr(), "{}", Printable(text));
}

fn put(text: impl Display) -> io::Result<()> {
    match writeln!(io::stdout(), "{text}") {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}
