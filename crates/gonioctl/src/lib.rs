//! The technician's command line: a thin client of the libraries, which does nothing that they lack.
//!
//! Data goes to stdout, talk to stderr; the exit code says how it ended.

mod acknowledge;
mod bound;
mod calibrate;
mod campaign;
mod cli;
mod closing;
mod conform;
mod convert;
mod doctor;
mod document;
mod errand;
mod error;
mod eval;
mod exit;
mod export;
mod failure;
mod findings;
mod junit;
mod manual;
mod operator;
mod plan;
mod ports;
mod progress;
mod queue;
mod reconstruct;
mod run;
mod run_files;
mod schema;
mod screen;
mod signals;
mod study;
mod watch;
mod wedge;

use std::process::ExitCode;

use arms::{Arm, ArmAngle};
use cli::{ArmName, Cli, Command, DaemonArguments, Output, StudyCommand};
use failure::Failure;
use operator::OperatorCommand;
use run::Task;
use terminal::{LevelFilter, LogFormat};

/// Runs the command line of this process and returns its exit code.
pub fn main() -> ExitCode {
    let cli: Cli = match terminal::arguments(|error| Failure::of_arguments(error).tell_machines()) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    // A campaign has things go wrong on purpose; what it finds is printed at its end.
    let least = match cli.command {
        Command::Campaign { .. } => LevelFilter::OFF,
        _ => LevelFilter::WARN,
    };
    terminal::log(LogFormat::Human, least);
    match command(cli.command) {
        Ok(code) => code,
        Err(error) => {
            let (failure, status) = Failure::of(&error);
            failure.tell_machines();
            terminal::say(format_args!("gonioctl: {}", failure.message()));
            exit::code(status)
        }
    }
}

fn command(command: Command) -> anyhow::Result<ExitCode> {
    match command {
        Command::Ports { output } => ports::ports(output.json)?,
        Command::Doctor {
            rig,
            out,
            junit,
            output,
        } => {
            return junit.of("doctor", |junit| {
                doctor::doctor(rig.rig.as_deref(), &out, junit, output.json)
            });
        }
        Command::Conform {
            rig,
            restart,
            junit,
            output,
        } => {
            return junit.of("conform", |junit| {
                conform::conform(rig.rig.as_deref(), restart, junit, output.json)
            });
        }
        Command::Plan {
            job,
            rig,
            hash,
            output,
        } => match hash {
            true => plan::hash(&job, rig.rig.as_deref(), output.json)?,
            false => plan::plan(&job, rig.rig.as_deref(), output.json)?,
        },
        Command::Run {
            job,
            rig,
            out,
            resume,
            daemon,
            output,
        } => {
            let rig = rig.rig.as_deref();
            let task = match (&job, &resume) {
                (_, Some(directory)) => Task::Resume { directory, rig },
                (Some(job), None) => Task::New {
                    job,
                    rig,
                    out: out.as_deref(),
                },
                (None, None) => unreachable!("clap requires one of them"),
            };
            return run::run(&task, &daemon, output.json);
        }
        Command::Calibrate(arguments) => return calibrate::calibrate(&arguments),
        Command::Submit { job, daemon, output } => queue::submit(&daemon.client()?, &job, output.json)?,
        Command::Jobs { all, daemon, output } => queue::jobs(&daemon.client()?, all, output.json)?,
        Command::Ready { job, daemon, output } => queue::ready(&daemon.client()?, job, output.json)?,
        Command::Watch { job, daemon, output } => {
            return watch::watch(&daemon.client()?, job, output.json);
        }
        Command::Pause { daemon, output } => return send(OperatorCommand::Pause, &daemon, output),
        Command::Resume { job, daemon, output } => queue::resume(&daemon.client()?, job, output.json)?,
        Command::Stop { daemon, output } => return send(OperatorCommand::Stop, &daemon, output),
        Command::Estop { daemon, output } => return send(OperatorCommand::Estop, &daemon, output),
        Command::Acknowledge {
            fault,
            daemon,
            output,
        } => return acknowledge::acknowledge(&daemon.client()?, fault.as_deref(), output.json),
        Command::Cancel { job, daemon, output } => queue::cancel(&daemon.client()?, job, output.json)?,
        Command::Jog {
            arm,
            angle_deg,
            daemon,
            output,
        } => {
            let arm = match arm {
                ArmName::Light => Arm::Light,
                ArmName::Sensor => Arm::Sensor,
            };
            return send(
                OperatorCommand::Jog(arm, ArmAngle::from_deg(angle_deg)),
                &daemon,
                output,
            );
        }
        Command::Park { daemon, output } => return send(OperatorCommand::Park, &daemon, output),
        Command::Export {
            run,
            format,
            to,
            wedges,
            daemon,
        } => export::export(run.as_deref(), &daemon, &format, to.as_deref(), &wedges)?,
        Command::Convert { from, to, format } => convert::convert(&from, &to, format.as_deref())?,
        Command::Eval {
            truth,
            estimate,
            fail_above,
            junit,
            output,
        } => {
            return junit.of("eval", |junit| {
                eval::eval(&truth, &estimate, &fail_above, junit, output.json)
            });
        }
        Command::Study {
            command: Some(StudyCommand::Merge { study }),
            ..
        } => study::merge(&study)?,
        Command::Study { study, shard, .. } => study::study(&study, shard)?,
        Command::Campaign {
            captures,
            seed,
            wire,
            replay,
            junit,
            output,
        } => {
            return junit.of("campaign", |junit| match replay {
                Some(script) => campaign::replay(&script, junit, output.json),
                None => campaign::campaign(captures, seed, wire, junit, output.json),
            });
        }
        Command::Schema { name } => schema::schema(&name)?,
        Command::Completions { shell } => manual::completions(shell)?,
        Command::Man { directory } => manual::man(&directory)?,
        Command::Reconstruct { run, output } => return reconstruct::reconstruct(run, output.json),
    }
    Ok(ExitCode::SUCCESS)
}

fn send(command: OperatorCommand, daemon: &DaemonArguments, output: Output) -> anyhow::Result<ExitCode> {
    command.send(&daemon.client()?, output.json)
}
