use std::path::Path;
use std::process::{Command, Output};

/// A program that ended.
#[derive(Debug)]
pub struct Finished {
    /// Its exit code; −1 where a signal ended it.
    pub code: i32,
    /// What it printed.
    pub stdout: String,
    /// What it said.
    pub stderr: String,
}

impl From<Output> for Finished {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code().unwrap_or(-1),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

impl Finished {
    /// The same, after asserting its exit code.
    ///
    /// # Panics
    /// If it ended with another code; shows what it said.
    #[must_use]
    pub fn expect(self, code: i32) -> Self {
        assert_eq!(
            self.code, code,
            "exit code\n--- stdout\n{}\n--- stderr\n{}",
            self.stdout, self.stderr
        );
        self
    }
}

/// Runs a program in a directory until it ends.
///
/// # Panics
/// If it cannot be started.
pub fn run(program: &str, directory: &Path, arguments: &[&str]) -> Finished {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(directory)
        .env_remove("RUST_LOG")
        .env_remove("GONIOD_URL")
        .output();
    output
        .unwrap_or_else(|error| panic!("cannot start {program}: {error}"))
        .into()
}
