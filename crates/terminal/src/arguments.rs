use std::process::ExitCode;

use clap::Parser;

use crate::say;

/// Returns what the arguments of this process say. What is wrong with them is printed and given to `refused`, in words;
/// help that they ask for is printed.
///
/// # Errors
/// The exit code with which the process should end.
pub fn arguments<T: Parser>(refused: impl FnOnce(&str)) -> Result<T, ExitCode> {
    T::try_parse().map_err(|error| {
        let code = u8::try_from(error.exit_code()).unwrap_or(u8::MAX);
        if error.use_stderr() {
            // It repeats what was given, which may have come out of a file or from a glob.
            let text = error.render().to_string();
            refused(text.trim_end());
            text.trim_end().lines().for_each(say);
        } else {
            // Help is our own text. Nobody reads it where stdout is gone.
            let _ = error.print();
        }
        ExitCode::from(code)
    })
}
