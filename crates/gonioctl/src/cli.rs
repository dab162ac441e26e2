use std::path::PathBuf;

use anyhow::Result;
use api::client::Refused;
use api::{Client, ClientError, JobId};
use clap::builder::PossibleValuesParser;
use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use formats::FORMATS;
use study::Shard;

use crate::bound::Bound;
use crate::junit::Junit;
use crate::wedge::Wedge;
use crate::{export, schema};

/// Measures how a flat specimen reflects light, with two servo arms and a photometer.
///
/// Data goes to stdout, talk to stderr. Exit codes: 0 done; 1 an error is above the bound of `eval --fail-above`; 2 bad
/// arguments, config or file; 3 rig fault or missing device; 4 stopped before the end, resumable, also a full disk; 5 the daemon cannot be reached, or refuses; 6 measured,
/// but not usable: no or unusable readings, or no reconstruction.
#[derive(Debug, Parser)]
#[command(name = "gonioctl", version, max_term_width = 100)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Which study, and where.
#[derive(Debug, Args)]
pub(crate) struct StudyArguments {
    /// The study file; the built-in config/studies/error-against-time.toml unless given.
    pub(crate) study: Option<PathBuf>,
    /// Measure the materials of these files and folders instead of those that the study file names: BRDF files of any
    /// format that can be read, and CSV files of scattered readings.
    ///
    /// A CSV file has a header line and the zenith angles of light and sensor and the azimuth between them in degrees
    /// (180 is the side of the mirror direction), then the reflectance in red, green and blue in 1/sr.
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub(crate) on: Vec<PathBuf>,
    /// Of the materials of --on, measure every N-th.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "on")]
    pub(crate) every: usize,
    /// A small part of it, within a minute.
    #[arg(long)]
    pub(crate) quick: bool,
    /// Where rows, plots and the page are written; studies/NAME unless given.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// What is done with a study beside running it.
#[derive(Debug, Subcommand)]
pub(crate) enum StudyCommand {
    /// Make the study of what its shards did, the same files as without shards. Name the study as for its shards.
    Merge {
        #[command(flatten)]
        study: StudyArguments,
    },
}

/// In the order of a working day.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// List the serial ports that a rig may be on.
    Ports {
        #[command(flatten)]
        output: Output,
    },
    /// Say what is wrong with the rig and what to do about it. Moves nothing; switches the lamp on for a moment.
    Doctor {
        #[command(flatten)]
        rig: RigArgument,
        /// Where run directories are to go; its disk is looked at.
        #[arg(long, value_name = "DIR", default_value = "runs")]
        out: PathBuf,
        #[command(flatten)]
        junit: JunitArgument,
        #[command(flatten)]
        output: Output,
    },
    /// Try whether the rig behaves as this program expects of it. Moves the arms: stand by.
    Conform {
        #[command(flatten)]
        rig: RigArgument,
        /// Restart the servos too: their arms have no torque meanwhile.
        #[arg(long)]
        restart: bool,
        #[command(flatten)]
        junit: JunitArgument,
        #[command(flatten)]
        output: Output,
    },
    /// Say what a job would do: readings, seconds, what is left out and why. Touches no hardware.
    Plan {
        /// The job file.
        job: PathBuf,
        #[command(flatten)]
        rig: RigArgument,
        /// Print a key of the job on this rig instead, under which its results can be kept: it is another one whenever what
        /// would be measured, or how, is another, and does not depend on comments, white space or the order of keys.
        #[arg(long)]
        hash: bool,
        #[command(flatten)]
        output: Output,
    },
    /// Capture a job and reconstruct the BRDF.
    ///
    /// Where a daemon runs that has the rig, it does that, and keeps the run among its own; else this command does.
    Run {
        /// The job file.
        #[arg(required_unless_present = "resume", conflicts_with = "resume")]
        job: Option<PathBuf>,
        #[command(flatten)]
        rig: RigArgument,
        /// Where run directories are made [default: runs]. No daemon is asked where it is given.
        #[arg(long, value_name = "DIR", conflicts_with = "resume")]
        out: Option<PathBuf>,
        /// Go on with a run that was interrupted, from its directory; --rig may name a rig file with another port,
        /// where the rig is connected elsewhere now.
        #[arg(long, value_name = "RUN_DIR")]
        resume: Option<PathBuf>,
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Measure a standard that lies on the stage, and store what it says of the rig. The arms move.
    Calibrate(CalibrateArguments),
    /// Add a job to the daemon's queue; prints its id.
    Submit {
        /// The job file.
        job: PathBuf,
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// List the jobs that are not over.
    Jobs {
        /// Those that are over too.
        #[arg(long)]
        all: bool,
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Say that a job's specimen is on the stage: it starts.
    Ready {
        /// Id of the job; the one that waits for its specimen unless given.
        job: Option<JobId>,
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Show live what happens: of one job until it ends, else until Ctrl-C.
    Watch {
        /// Id of the job.
        job: Option<JobId>,
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Finish the reading, then hold.
    Pause {
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Go on after a pause, or with a job that was interrupted.
    Resume {
        /// Id of the job; what is paused, else the interrupted one, unless given.
        job: Option<JobId>,
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Brake now, hold the arms, lamp off; the job can be resumed, and nothing starts until an operator starts it.
    Stop {
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Emergency stop: arms and lamp at once, and no motion until it is acknowledged.
    Estop {
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Acknowledge a fault by its id: somebody has looked at the rig. Shows the newest one and asks, unless it is named.
    Acknowledge {
        /// Id of the fault, as `gonioctl watch`, the page and the daemon's log show it.
        #[arg(long, value_name = "ID")]
        fault: Option<String>,
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Give a job up.
    Cancel {
        /// Id of the job.
        job: JobId,
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Move one arm by hand, within the envelope.
    Jog {
        /// Which arm.
        arm: ArmName,
        /// Where to, degrees from the normal, positive towards +x.
        #[arg(allow_negative_numbers = true, value_name = "DEGREES")]
        angle_deg: f64,
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Take both arms to rest.
    Park {
        #[command(flatten)]
        daemon: DaemonArguments,
        #[command(flatten)]
        output: Output,
    },
    /// Make everything in a run directory again from its journal, or from the store of the daemon that captured it.
    Reconstruct {
        /// The run directory.
        run: PathBuf,
        #[command(flatten)]
        output: Output,
    },
    /// Write the result of a run in one format to a file, or to stdout; the file is read back before it is done.
    ///
    /// It does not matter whether the run wrote that format: the model is rebuilt from the readings.
    Export {
        /// The run directory; or the id of a run, in ./runs or at the daemon; or the address of a daemon, alone for its newest
        /// run with a result, or with /runs/ID behind it.
        run: Option<String>,
        /// What to write: a format, "csv" for the readings, "all" for a ZIP archive of everything, or "list" to list all
        /// formats with what they keep.
        #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(export::words()))]
        format: String,
        /// Where to: a file, or a directory, in which it is named for the specimen, the date and the format; stdout unless
        /// given.
        #[arg(long, value_name = "FILE")]
        to: Option<PathBuf>,
        /// Correct the result out of the arms' plane by a run of the same specimen that lay on a wedge of so many degrees, 15 …
        /// 60, about the line in which that plane meets the stage; once for each such run. What it changed is told.
        #[arg(long = "wedge", value_name = "DEGREES=RUN")]
        wedges: Vec<Wedge>,
        #[command(flatten)]
        daemon: DaemonArguments,
    },
    /// Write a BRDF file of any format in another one; the file is read back before it is done.
    Convert {
        /// The file, or a fitted MERL material, "lambert:ALBEDO" or "mirror:REFLECTANCE".
        #[arg(value_name = "IN")]
        from: String,
        /// The new file.
        #[arg(value_name = "OUT")]
        to: PathBuf,
        /// Its format; the one that its extension belongs to unless given.
        #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(FORMATS.iter().map(|format| format.name)))]
        format: Option<String>,
    },
    /// Compare two BRDFs: every error metric.
    Eval {
        /// The truth: a MERL file, a fitted MERL material, "lambert:ALBEDO" or "mirror:REFLECTANCE".
        truth: String,
        /// The estimate, likewise.
        estimate: String,
        /// Exit with 1 where a metric is above a bound, or has no value: names of the table, such as male=0.001,p95_rel=0.2.
        #[arg(long, value_name = "METRIC=BOUND", value_delimiter = ',')]
        fail_above: Vec<Bound>,
        #[command(flatten)]
        junit: JunitArgument,
        #[command(flatten)]
        output: Output,
    },
    /// Error against run time, over materials, plans and models on the simulated rig; or what a study file asks for.
    ///
    /// A study that was interrupted goes on where it stopped.
    #[command(args_conflicts_with_subcommands = true)]
    Study {
        #[command(flatten)]
        study: StudyArguments,
        /// Do only part K of N, into a directory that all parts share; `study merge` makes the study of them. A part that is
        /// done again does no harm.
        #[arg(long, value_name = "K/N")]
        shard: Option<Shard>,
        #[command(subcommand)]
        command: Option<StudyCommand>,
    },
    /// Let things go wrong in thousands of simulated captures: each must end true, or with a clear fault, safe and
    /// resumable.
    ///
    /// What does not is printed as a script, cut down to the faults that it takes, and the exit code is 3.
    Campaign {
        /// How many captures.
        #[arg(long, value_name = "N", default_value_t = 10_000)]
        captures: u64,
        /// Seed of the first one; the others follow. A fresh one unless given.
        #[arg(long, value_name = "S", value_parser = clap::value_parser!(u64).range(..1 << 62))]
        seed: Option<u64>,
        /// Over pseudo-terminals, whose wires fail too.
        #[arg(long)]
        wire: bool,
        /// Do one script again.
        #[arg(long, value_name = "FILE", conflicts_with_all = ["captures", "seed", "wire"])]
        replay: Option<PathBuf>,
        #[command(flatten)]
        junit: JunitArgument,
        #[command(flatten)]
        output: Output,
    },
    /// Print the JSON Schema of a job file, of a rig file, or of something that a command prints with --json.
    Schema {
        /// "job", "rig", or what stands before the / in the key "schema" of the JSON that is printed.
        #[arg(value_name = "NAME", value_parser = PossibleValuesParser::new(schema::names()))]
        name: String,
    },
    /// Print the script with which a shell completes these commands.
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Write the manual pages, one for each command.
    Man {
        /// Where to; made where there is none.
        #[arg(value_name = "DIR")]
        directory: PathBuf,
    },
}

/// What is calibrated with what.
#[derive(Debug, Args)]
pub(crate) struct CalibrateArguments {
    #[command(subcommand)]
    pub(crate) stage: OnStage,
    #[command(flatten)]
    pub(crate) rig: RigArgument,
    /// What lies on the stage of the built-in simulator, where that is not what stands for the standard.
    #[arg(long, global = true)]
    pub(crate) specimen: Option<String>,
    #[command(flatten)]
    pub(crate) output: Output,
}

/// What lies on the stage. A mirror comes first, then the trap, then the white reference.
#[derive(Debug, Subcommand)]
pub(crate) enum OnStage {
    /// A mirror: what is to be added to the arms' angles.
    Mirror,
    /// A black trap: stray light.
    Trap,
    /// A white reference: responsivity, gains, linearity.
    White {
        /// Its certificate: name, u_percent and tables `at` with light_deg, sensor_deg, reflectance_factor; 98 % ± 0.5 % at
        /// 45°/0° unless given.
        #[arg(long, value_name = "FILE.toml")]
        standard: Option<PathBuf>,
    },
    /// A colour patch; with three or more the colour matrix.
    Patch {
        /// Its name; measured again, it takes the place of the one before.
        #[arg(long)]
        name: String,
        /// Certified reflectance factor at 45°/0° in linear sRGB: red, green, blue.
        #[arg(long, value_delimiter = ',', num_args = 3)]
        rgb: Vec<f64>,
    },
}

/// Which rig.
#[derive(Debug, Args)]
pub(crate) struct RigArgument {
    /// The rig file; config/rig.toml here unless given, else the built-in one.
    #[arg(long, value_name = "RIG.toml", global = true)]
    pub(crate) rig: Option<PathBuf>,
}

/// Which daemon.
#[derive(Clone, Debug, Args)]
pub(crate) struct DaemonArguments {
    /// Where the daemon is: unix:PATH, http://HOST:PORT, or https://HOST/PATH [default: the socket
    /// $XDG_RUNTIME_DIR/goniod.sock or /run/goniod/goniod.sock, else http://127.0.0.1:4664].
    #[arg(long, value_name = "ADDRESS", env = "GONIOD_URL")]
    pub(crate) daemon: Option<String>,
    /// File with the token that is needed over TCP: the token alone, or the daemon's tokens.toml.
    #[arg(long, value_name = "FILE", env = "GONIOD_TOKEN_FILE")]
    pub(crate) token_file: Option<PathBuf>,
    /// File with the certificates (PEM) of who vouches for the daemon's https, instead of the system's.
    #[arg(long, value_name = "FILE", env = "GONIOD_CA")]
    pub(crate) ca: Option<PathBuf>,
}

impl DaemonArguments {
    /// Whether nobody asked for a daemon that refuses so: it is not named, and wants a token that was not given.
    pub(crate) fn is_unasked(&self, refused: &Refused) -> bool {
        self.daemon.is_none() && self.token_file.is_none() && refused.unauthorized()
    }

    /// The same for the daemon at an address.
    pub(crate) fn at(&self, address: &str) -> Self {
        Self {
            daemon: Some(address.to_owned()),
            ..self.clone()
        }
    }

    /// The client of that daemon; asks nothing yet.
    ///
    /// # Errors
    /// As [`Client::new`].
    pub(crate) fn client(&self) -> Result<Client, ClientError> {
        Client::new(
            self.daemon.as_deref(),
            self.token_file.as_deref(),
            self.ca.as_deref(),
        )
    }
}

/// One of the arms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ArmName {
    /// The one that carries the light.
    Light,
    /// The one that carries the sensor.
    Sensor,
}

/// A file for CI servers.
#[derive(Debug, Args)]
pub(crate) struct JunitArgument {
    /// Also write what was found as a JUnit XML file, which CI servers show.
    #[arg(long, value_name = "FILE")]
    pub(crate) junit: Option<PathBuf>,
}

impl JunitArgument {
    /// Does something of which the file tells, also where it fails.
    ///
    /// # Errors
    /// The file cannot be written; those of what is done.
    pub(crate) fn of<T>(self, suite: &str, act: impl FnOnce(Option<&Junit>) -> Result<T>) -> Result<T> {
        let junit = self.junit.map(|path| Junit::begin(&path, suite)).transpose()?;
        let done = act(junit.as_ref());
        if let (Some(junit), Err(error)) = (&junit, &done) {
            junit.error(&format!("{error:#}"))?;
        }
        done
    }
}

/// How results are printed.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Output {
    /// Print JSON for machines.
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn run_takes_a_job_or_a_run_directory_and_not_both() {
        let parse = |arguments: &[&str]| Cli::try_parse_from([&["gonioctl", "run"], arguments].concat());
        assert!(parse(&["job.toml"]).is_ok());
        assert!(parse(&["--resume", "runs/1"]).is_ok());
        assert!(parse(&["--resume", "runs/1", "--rig", "rig.toml"]).is_ok());
        assert!(parse(&[]).is_err());
        assert!(parse(&["job.toml", "--resume", "runs/1"]).is_err());
        assert!(parse(&["--resume", "runs/1", "--out", "elsewhere"]).is_err());
    }

    #[test]
    fn a_study_is_done_whole_in_shards_or_merged() {
        let parse = |arguments: &[&str]| Cli::try_parse_from([&["gonioctl", "study"], arguments].concat());
        let merges = |arguments: &[&str]| {
            let command = parse(arguments).unwrap().command;
            matches!(
                command,
                Command::Study {
                    command: Some(StudyCommand::Merge { .. }),
                    ..
                }
            )
        };
        assert!(!merges(&["study.toml", "--shard", "3/16", "--out", "shared"]));
        assert!(merges(&["merge", "study.toml", "--quick", "--out", "shared"]));
        assert!(merges(&["merge"]) && !merges(&[]) && !merges(&["./merge"]));
        let error = parse(&["--shard", "4/3"]).unwrap_err().to_string();
        assert!(error.contains("a shard is K/N with 1 ≤ K ≤ N"), "{error}");
        assert!(parse(&["merge", "--shard", "1/3"]).is_err());
    }
}
