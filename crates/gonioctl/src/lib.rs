//! The technician's command line: a thin client of the libraries, which does nothing that they lack.
//!
//! Data goes to stdout, talk to stderr; the exit code says how it ended.

mod calibrate;
mod cli;
mod doctor;
mod eval;
mod exit;
mod export;
mod manual;
mod plan;
mod ports;
mod print;
mod progress;
mod reconstruct;
mod run;
mod signals;
mod study;

use std::process::ExitCode;

use clap::Parser;
use cli::{Cli, Command};
use run::Task;
use tracing_subscriber::EnvFilter;

/// Runs the command line of this process and returns its exit code.
pub fn main() -> ExitCode {
    tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn")))
        .with_writer(std::io::stderr)
        .init();
    match command(Cli::parse().command) {
        Ok(code) => code,
        Err(error) => {
            let (code, text) = exit::failure(&error);
            print::say(format_args!("gonioctl: {text}"));
            code
        }
    }
}

fn command(command: Command) -> anyhow::Result<ExitCode> {
    match command {
        Command::Ports { output } => ports::ports(output.json)?,
        Command::Doctor { rig, out, output } => return doctor::doctor(rig.rig.as_deref(), &out, output.json),
        Command::Plan { job, rig, output } => plan::plan(&job, rig.rig.as_deref(), output.json)?,
        Command::Run {
            job,
            rig,
            out,
            resume,
            output,
        } => {
            let task = match (&job, &resume) {
                (_, Some(directory)) => {
                    anyhow::ensure!(
                        rig.rig.is_none(),
                        "--rig: a run goes on with the rig file that it began with"
                    );
                    Task::Resume(directory)
                }
                (Some(job), None) => Task::New {
                    job,
                    rig: rig.rig.as_deref(),
                    out: &out,
                },
                (None, None) => unreachable!("clap requires one of them"),
            };
            return run::run(&task, output.json);
        }
        Command::Calibrate(arguments) => return calibrate::calibrate(&arguments),
        Command::Export { run, format, to } => export::export(&run, format, to.as_deref())?,
        Command::Eval {
            truth,
            estimate,
            output,
        } => eval::eval(&truth, &estimate, output.json)?,
        Command::Study { study, quick, out } => study::study(study.as_deref(), quick, out)?,
        Command::Completions { shell } => manual::completions(shell)?,
        Command::Man { directory } => manual::man(&directory)?,
        Command::Reconstruct { run, output } => reconstruct::reconstruct(run, output.json)?,
    }
    Ok(ExitCode::SUCCESS)
}
