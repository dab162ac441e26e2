use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

/// Measures how a flat specimen reflects light, with two servo arms and a photometer.
///
/// Data goes to stdout, talk to stderr. Exit codes: 0 done; 2 bad arguments, config or file; 3 rig fault or missing
/// device; 4 stopped before the end, resumable, also a full disk.
#[derive(Debug, Parser)]
#[command(name = "gonioctl", version, max_term_width = 100)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// In the order of a working day.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// List the serial ports that a rig may be on.
    Ports {
        #[command(flatten)]
        output: Output,
    },
    /// Say what a job would do: readings, seconds, what is left out and why. Touches no hardware.
    Plan {
        /// The job file.
        job: PathBuf,
        #[command(flatten)]
        rig: RigArgument,
        #[command(flatten)]
        output: Output,
    },
    /// Capture a job and reconstruct the BRDF.
    Run {
        /// The job file.
        #[arg(required_unless_present = "resume", conflicts_with = "resume")]
        job: Option<PathBuf>,
        #[command(flatten)]
        rig: RigArgument,
        /// Where run directories are made.
        #[arg(long, value_name = "DIR", default_value = "runs", conflicts_with = "resume")]
        out: PathBuf,
        /// Go on with a run that was stopped or failed, from its directory.
        #[arg(long, value_name = "RUN_DIR")]
        resume: Option<PathBuf>,
        #[command(flatten)]
        output: Output,
    },
    /// Make everything in a run directory again from its journal.
    Reconstruct {
        /// The run directory.
        run: PathBuf,
        #[command(flatten)]
        output: Output,
    },
}

/// Which rig.
#[derive(Debug, Args)]
pub(crate) struct RigArgument {
    /// The rig file; config/rig.toml here unless given, else the built-in one.
    #[arg(long, value_name = "RIG.toml")]
    pub(crate) rig: Option<PathBuf>,
}

/// How results are printed.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Output {
    /// Print JSON for machines.
    #[arg(long)]
    pub(crate) json: bool,
}
