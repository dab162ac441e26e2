use std::path::Path;
use std::process;
use std::sync::Arc;

use api::{Action, Client, ClientError, Job, JobId, JobState};
use capture::{Command, FileJournal, Record};
use rig::RigFile;
use serde_json::Value;
use session::Status;

use crate::cli::DaemonArguments;
use crate::closing::Closing;
use crate::error::CommandError;
use crate::signals::{STEPS, Signals};
use crate::{queue, watch};

/// A job that a daemon carries out while its client waits.
pub(crate) struct Errand {
    daemon: Arc<Client>,
    job: JobId,
}

impl Errand {
    /// Hands a job file to the daemon that has its rig: the daemon that is named, else the one at the usual address
    /// where it runs and its rig file says the same. `None`: there is no such daemon.
    ///
    /// # Errors
    /// A file that is wrong; a daemon that is named and not there, has another rig, or refuses; one that is busy.
    pub(crate) fn begin(
        job: &Path,
        rig: Option<&Path>,
        arguments: &DaemonArguments,
    ) -> anyhow::Result<Option<Self>> {
        let daemon = arguments.client()?;
        let text = match daemon.read_text("/rig/file") {
            Err(ClientError::Unreachable { .. }) if arguments.daemon.is_none() => return Ok(None),
            Err(ClientError::Refused(refused)) if arguments.is_unasked(&refused) => {
                terminal::say(format_args!("a daemon runs here that is not asked: {refused}"));
                return Ok(None);
            }
            text => text?,
        };
        if (arguments.daemon.is_none() || rig.is_some())
            && let Some(name) = other_rig(&text, rig)?
        {
            anyhow::ensure!(
                arguments.daemon.is_none(),
                "--rig: the daemon drives another rig than {name}"
            );
            terminal::say(format_args!(
                "the daemon drives another rig than {name}; it is not asked"
            ));
            return Ok(None);
        }
        free(&daemon)?;
        let job = queue::hand_in(&daemon, job, true)?.id;
        start(&daemon, job)?;
        Ok(Some(Self {
            daemon: Arc::new(daemon),
            job,
        }))
    }

    /// Has the daemon go on with a run that it began. `None`: it did not begin it, or the run is over.
    ///
    /// # Errors
    /// A daemon that is named and not there, has another rig than `rig` says, or refuses.
    pub(crate) fn resume(
        directory: &Path,
        rig: Option<&Path>,
        arguments: &DaemonArguments,
    ) -> anyhow::Result<Option<Self>> {
        // What is wrong with a directory is told by who goes on without a daemon.
        let records = FileJournal::read(directory.join("journal")).unwrap_or_default();
        let Some(Record::Header(header)) = records.first() else {
            return Ok(None);
        };
        let daemon = arguments.client()?;
        let run = match daemon.run(&header.run) {
            Err(ClientError::Unreachable { .. }) if arguments.daemon.is_none() => return Ok(None),
            Err(ClientError::Refused(refused)) if refused.not_found() => return Ok(None),
            run => run?,
        };
        let job = daemon.job(run.job)?;
        if job.state.over() {
            return Ok(None);
        }
        // Its readings go on in the daemon's store, so nobody else may go on with it.
        if rig.is_some()
            && let Some(name) = other_rig(&daemon.read_text("/rig/file")?, rig)?
        {
            anyhow::bail!(
                "--rig: the daemon that began this run drives another rig than {name}: correct its rig file and start \
                 it again"
            );
        }
        daemon.act_on_job(job.id, Action::Resume)?;
        Ok(Some(Self {
            daemon: Arc::new(daemon),
            job: job.id,
        }))
    }

    /// Shows how it goes on until it has ended, and obeys signals: the first one stops the job, the second one is the
    /// emergency stop.
    ///
    /// # Errors
    /// A job that never began, and why; a daemon that refuses.
    pub(crate) fn wait(self) -> anyhow::Result<Closing> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()?;
        let signals = {
            let _within = runtime.enter();
            Signals::listen()?
        };
        runtime.spawn(obey(signals, self.daemon.clone()));
        let (job, status) = watch::until_ended(&self.daemon, self.job)?;
        let Some(id) = job.run else {
            let why = job.why.unwrap_or_else(|| format!("the job is {}", job.state));
            return Err(CommandError::Unbegun { why, status }.into());
        };
        let run = self.daemon.run(&id)?;
        // They are missing where they could not be written; the fault that says so was told.
        let file = |name: &str| -> Value {
            let told = self.daemon.read(&format!("/runs/{id}/files/{name}"));
            told.unwrap_or_default()
        };
        Ok(Closing {
            status,
            directory: run.directory,
            run: file("run.json"),
            report: file("report.json"),
            again: format!("gonioctl resume {}", job.id),
        })
    }
}

/// Name of the rig file here, the one named or the one that is found, where a daemon's rig file says something else.
///
/// # Errors
/// The rig file here cannot be read, or is wrong.
fn other_rig(daemons: &str, rig: Option<&Path>) -> anyhow::Result<Option<String>> {
    let (here, name) = session::rig_file(rig)?;
    let same = RigFile::parse(daemons, "the daemon's rig file".as_ref()).ok() == Some(here);
    Ok((!same).then(|| name.display().to_string()))
}

/// Whether a daemon could begin a job now: `run` waits for nobody.
fn free(daemon: &Client) -> anyhow::Result<()> {
    if let Some(fault) = daemon.rig()?.fault {
        return Err(CommandError::Busy(format!(
            "a fault is latched ({}): look at the rig, then `gonioctl acknowledge`",
            fault.text
        ))
        .into());
    }
    let jobs = daemon.jobs()?;
    let before = |job: &&Job| !job.state.over() && job.state != JobState::Interrupted;
    match jobs.iter().find(before) {
        Some(job) => Err(CommandError::Busy(format!(
            "job {} is {}: wait for it (`gonioctl watch`), or queue this one with `gonioctl submit`",
            job.id, job.state
        ))
        .into()),
        None => Ok(()),
    }
}

/// Says that the specimen is on the stage: whoever says `run` has put it there. A job that cannot start is taken back.
fn start(daemon: &Client, id: JobId) -> Result<(), ClientError> {
    let Err(refusal) = daemon.act_on_job(id, Action::Ready) else {
        return Ok(());
    };
    // One whose file says that it lies there has set off by itself.
    let job = daemon.job(id)?;
    if !matches!(job.state, JobState::Queued | JobState::AwaitingSpecimen) {
        return Ok(());
    }
    daemon.act_on_job(id, Action::Cancel)?;
    Err(refusal)
}

async fn obey(mut signals: Signals, daemon: Arc<Client>) {
    for (command, word) in STEPS {
        signals.next().await;
        let path = match command {
            Command::Estop => "/estop",
            _ => "/finish",
        };
        terminal::say(word);
        let daemon = daemon.clone();
        // Not waited for: the emergency stop must not wait for an answer to what was asked before.
        tokio::task::spawn_blocking(move || {
            let Err(error) = daemon.act(path) else { return };
            terminal::say(format_args!("gonioctl: {error}"));
            if matches!(error, ClientError::Unreachable { .. }) {
                // Nobody is there who could obey; the rig's own watchdogs stop it.
                process::exit(Status::Daemon.code().into());
            }
        });
    }
}
