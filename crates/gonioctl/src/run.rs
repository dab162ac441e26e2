use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use capture::{Command, Event};
use session::{Ended, RunRequest, SessionError};
use tokio::sync::watch;

use crate::cli::DaemonArguments;
use crate::closing::Closing;
use crate::errand::Errand;
use crate::exit;
use crate::progress::Progress;
use crate::signals::{STEPS, Signals};

/// Where run directories are made unless told otherwise.
const RUNS: &str = "runs";

/// What `run` is to do.
pub(crate) enum Task<'a> {
    /// A new run of a job.
    New {
        job: &'a Path,
        rig: Option<&'a Path>,
        /// Where its directory is made; `None`: nobody said.
        out: Option<&'a Path>,
    },
    /// Go on with a run directory.
    Resume(&'a Path),
}

/// Captures, reconstructs and says where everything is; or has a daemon do that, where one has the rig.
///
/// # Errors
/// Whatever keeps the run from beginning, or its results from being written.
pub(crate) fn run(task: &Task<'_>, daemon: &DaemonArguments, json: bool) -> anyhow::Result<ExitCode> {
    let begun = Instant::now();
    let errand = match *task {
        Task::New { job, rig, out: None } => Errand::begin(job, rig, daemon)?,
        Task::New { .. } => None,
        Task::Resume(directory) => Errand::resume(directory, daemon)?,
    };
    let closing = match errand {
        Some(errand) => errand.wait()?,
        None => alone(task)?,
    };
    let wall_s = begun.elapsed().as_secs_f64();
    if json {
        terminal::json(&closing.summary(wall_s))?;
    } else {
        closing.say(wall_s);
        terminal::line(closing.directory.display())?;
        closing.say_last();
    }
    Ok(exit::code(closing.status))
}

/// Does it in this process.
fn alone(task: &Task<'_>) -> anyhow::Result<Closing> {
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
    Ok(Closing::of(&ended)?)
}

/// Hands what signals ask for to the capture.
pub(crate) async fn obey(mut signals: Signals, sender: watch::Sender<Command>) {
    for (command, word) in STEPS {
        signals.next().await;
        // Nobody listens any more once the capture has ended.
        match sender.send(command) {
            Ok(()) => terminal::say(word),
            Err(_) => terminal::say("the capture has already ended; its results are being written"),
        }
    }
}

async fn capture(task: &Task<'_>, control: watch::Receiver<Command>) -> anyhow::Result<Ended> {
    let mut progress = Progress::new();
    let mut show = |event: Event| {
        tracing::debug!(?event);
        progress.show(&event);
    };
    let ended: Result<Ended, SessionError> = match task {
        Task::New { job, rig, out } => {
            let order = RunRequest::read(job, *rig)?;
            session::run(&order, out.unwrap_or(Path::new(RUNS)), control, &mut show).await
        }
        Task::Resume(directory) => session::resume(directory, control, &mut show).await,
    };
    progress.finish();
    Ok(ended?)
}
