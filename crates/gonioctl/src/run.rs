use std::path::Path;
use std::process::{self, ExitCode};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use capture::{Command, Event};
use session::{Ended, RunRequest, SessionError, Status};
use tokio::sync::watch;

use crate::cli::DaemonArguments;
use crate::closing::Closing;
use crate::document;
use crate::errand::Errand;
use crate::exit;
use crate::progress::Progress;
use crate::signals::{STEPS, Signals};

/// Where run directories are made unless told otherwise.
pub(crate) const RUNS: &str = "runs";

/// What `run` is to do.
pub(crate) enum Task<'a> {
    /// A new run of a job.
    New {
        job: &'a Path,
        rig: Option<&'a Path>,
        /// Where its directory is made; `None`: nobody said.
        out: Option<&'a Path>,
    },
    /// Go on with a run.
    Resume {
        /// Its directory.
        directory: &'a Path,
        /// Rig file that says where the rig is now; `None`: where the run began.
        rig: Option<&'a Path>,
    },
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
        Task::Resume { directory, rig } => Errand::resume(directory, rig, daemon)?,
    };
    let closing = match errand {
        Some(errand) => errand.wait()?,
        None => alone(task)?,
    };
    let wall_s = begun.elapsed().as_secs_f64();
    if json {
        document::RUN.print(&closing.summary(wall_s))?;
    } else {
        closing.say(wall_s);
        terminal::line(closing.directory.display())?;
        closing.say_last();
    }
    Ok(exit::code(closing.status))
}

/// Does it in this process.
fn alone(task: &Task<'_>) -> anyhow::Result<Closing> {
    // Before signals are listened for: reading may block, and until then a signal ends the program by itself.
    let order = match task {
        Task::New { job, rig, .. } => Some(RunRequest::read(job, *rig)?),
        Task::Resume { .. } => None,
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()?;
    let ended = runtime.block_on(async {
        let (sender, control) = watch::channel(Command::Run);
        // Before anything can move.
        let signals = Signals::listen()?;
        let begun = Arc::new(AtomicBool::new(false));
        tokio::spawn(obey(signals, sender, begun.clone()));
        capture(task, order.as_ref(), control, &begun).await
    })?;
    Ok(Closing::of(&ended)?)
}

/// Hands what signals ask for to the capture. Before `begun` is set nothing has moved or is lit, and after the capture
/// has ended nothing moves any more: then a signal, and a second one, ends the program at once, whatever it waits for.
pub(crate) async fn obey(mut signals: Signals, sender: watch::Sender<Command>, begun: Arc<AtomicBool>) {
    let mut steps = STEPS.into_iter();
    let mut warned = false;
    loop {
        signals.next().await;
        if !begun.load(Ordering::Acquire) {
            terminal::say("interrupted before the capture began; nothing has moved");
            process::exit(Status::Stopped.code().into());
        }
        // Nobody listens any more once the capture has ended.
        if sender.is_closed() {
            if warned {
                terminal::say("ended while the results were being written; the readings are safe");
                process::exit(Status::Stopped.code().into());
            }
            warned = true;
            terminal::say(
                "the capture has already ended; its results are being written; again to end without them",
            );
            continue;
        }
        // A third one changes nothing: the arms are already being stopped as fast as they can be.
        if let Some((command, word)) = steps.next() {
            sender.send_replace(command);
            terminal::say(word);
        }
    }
}

async fn capture(
    task: &Task<'_>,
    order: Option<&RunRequest>,
    control: watch::Receiver<Command>,
    begun: &AtomicBool,
) -> anyhow::Result<Ended> {
    let mut progress = Progress::new();
    let mut show = |event: Event| {
        begun.store(true, Ordering::Release);
        tracing::debug!(?event);
        progress.show(&event);
    };
    let ended: Result<Ended, SessionError> = match (task, order) {
        (Task::New { out, .. }, Some(order)) => {
            session::run(order, out.unwrap_or(Path::new(RUNS)), control, &mut show).await
        }
        (Task::Resume { directory, rig }, _) => session::resume(directory, *rig, control, &mut show).await,
        (Task::New { .. }, None) => unreachable!("a new run has its order"),
    };
    progress.finish();
    Ok(ended?)
}
