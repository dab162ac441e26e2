use std::process::ExitCode;

use clap::Parser;

use crate::say;

/// Returns what the arguments of this process say. What is wrong with them is printed, as is help that they ask for.
///
/// # Errors
/// The exit code with which the process should end.
pub fn arguments<T: Parser>() -> Result<T, ExitCode> {
    T::try_parse().map_err(|error| {
        let code = u8::try_from(error.exit_code()).unwrap_or(u8::MAX);
        if error.use_stderr() {
            // It repeats what was given, which may have come out of a file or from a glob.
            error.render().to_string().trim_end().lines().for_each(say);
        } else {
            // Help is our own text. Nobody reads it where stdout is gone.
            let _ = error.print();
        }
        ExitCode::from(code)
    })
}
