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

/// A command that starts a program whose files may not grow beyond so many blocks of 512 bytes. It stands for a full
/// disk: the write fails, in a process that is told so and not killed for it.
pub fn on_a_full_disk(program: &str, blocks: u32) -> Command {
    let mut shell = Command::new("sh");
    let limited = format!(r#"trap '' XFSZ; ulimit -f {blocks}; exec "$0" "$@""#);
    shell.args(["-c", &limited, program]);
    shell
}

/// Runs a program in a directory until it ends.
///
/// # Panics
/// If it cannot be started.
pub fn run(program: &str, directory: &Path, arguments: &[&str]) -> Finished {
    run_by(Command::new(program), directory, arguments)
}

/// Runs a command, with these arguments more, in a directory until it ends.
///
/// # Panics
/// If it cannot be started.
pub fn run_by(mut command: Command, directory: &Path, arguments: &[&str]) -> Finished {
    let output = command
        .args(arguments)
        .current_dir(directory)
        .env_remove("RUST_LOG")
        .env_remove("GONIOD_URL")
        .output();
    output
        .unwrap_or_else(|error| panic!("cannot start {command:?}: {error}"))
        .into()
}
