use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use capture::{Command, Event, Outcome};
use goniod::{DaemonError, Ended, Order};
use serde_json::json;
use tokio::sync::watch;

use crate::progress::{Progress, clock};
use crate::signals::Signals;
use crate::{eval, exit, print};

/// What `run` is to do.
pub(crate) enum Task<'a> {
    /// A new run of a job.
    New {
        job: &'a Path,
        rig: Option<&'a Path>,
        out: &'a Path,
    },
    /// Go on with a run directory.
    Resume(&'a Path),
}

/// Captures, reconstructs and says where everything is.
///
/// # Errors
/// Whatever keeps the run from beginning, or its results from being written.
pub(crate) fn run(task: &Task<'_>, json: bool) -> anyhow::Result<ExitCode> {
    let begun = Instant::now();
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()?;
    let ended = runtime.block_on(async {
        let (sender, control) = watch::channel(Command::Run);
        // Before anything can move.
        let signals = Signals::listen()?;
        tokio::spawn(obey(signals, sender));
        capture(task, control).await
    })?;
    let wall_s = begun.elapsed().as_secs_f64();
    if json {
        print::json(&summary(&ended, wall_s))?;
    } else {
        say(&ended, wall_s);
        print::line(ended.directory.path().display())?;
    }
    Ok(exit::code(ended.status()))
}

/// The first signal finishes the reading and holds, the second stops at once.
pub(crate) async fn obey(mut signals: Signals, sender: watch::Sender<Command>) {
    let words = [
        (
            Command::Finish,
            "stopping after this reading; again for an emergency stop",
        ),
        (Command::Estop, "emergency stop"),
    ];
    for (command, word) in words {
        signals.next().await;
        // Nobody listens any more once the capture has ended.
        match sender.send(command) {
            Ok(()) => print::say(word),
            Err(_) => print::say("the capture has already ended; its results are being written"),
        }
    }
}

async fn capture(task: &Task<'_>, control: watch::Receiver<Command>) -> anyhow::Result<Ended> {
    let mut progress = Progress::new();
    let mut show = |event: Event| {
        tracing::debug!(?event);
        progress.show(&event);
    };
    let ended: Result<Ended, DaemonError> = match task {
        Task::New { job, rig, out } => {
            let order = Order::read(job, *rig)?;
            goniod::run(&order, out, control, &mut show).await
        }
        Task::Resume(directory) => goniod::resume(directory, control, &mut show).await,
    };
    progress.finish();
    Ok(ended?)
}

/// The summary for machines.
fn summary(ended: &Ended, wall_s: f64) -> serde_json::Value {
    let run = &ended.report.run;
    json!({
        "id": run.id,
        "state": run.state,
        "exit_status": ended.status().code(),
        "fault": run.fault,
        "directory": ended.directory.path(),
        "rig_seconds": run.seconds.total,
        "wall_seconds": wall_s,
        "readings": run.readings,
        "retries": run.retries,
        "flags": run.flags,
        "errors": ended.report.errors,
        "adapted": ended.report.adapted,
    })
}

/// The summary for people.
fn say(ended: &Ended, wall_s: f64) {
    let run = &ended.report.run;
    match &ended.outcome {
        Outcome::Done => print::say("done"),
        Outcome::Stopped => print::say("stopped; the readings so far are safe"),
        Outcome::Failed { fault } => print::say(format_args!("failed: {fault}")),
    }
    print::say(format_args!(
        "rig time  {} ({:.1} s; what a real rig takes)",
        clock(run.seconds.total),
        run.seconds.total
    ));
    print::say(format_args!("wall time {wall_s:.1} s"));
    print::say(format_args!(
        "readings  {} taken, {} of {} steps done, {} retries on the bus",
        run.readings.taken, run.readings.accepted, run.readings.planned, run.retries
    ));
    if let Some(adapted) = &ended.report.adapted {
        adapted
            .added
            .iter()
            .for_each(|why| print::say(format_args!("added     {why}")));
        adapted
            .stopped
            .iter()
            .for_each(|why| print::say(format_args!("ended     {why}")));
    }
    if let Some(errors) = &ended.report.errors {
        print::say("errors against the simulated specimen");
        for line in eval::lines(errors) {
            print::say(line);
        }
    }
    if ended.outcome != Outcome::Done {
        print::say(format_args!(
            "go on with: gonioctl run --resume {}",
            ended.directory.path().display()
        ));
    }
}
