use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use capture::{Command, Event, Extension, FileJournal, Journal, Outcome, Record, Thinking};
use report::{Report, RunDirectory, Verdict};
use rig::RigFile;
use sweep::Job;
use tokio::sync::watch;

use crate::{OpenRig, RunRequest, SessionError, Status};

/// How a run ended, and what came of it.
#[derive(Debug)]
pub struct Ended {
    /// Where everything is.
    pub directory: RunDirectory,
    /// How the capture ended.
    pub outcome: Outcome,
    /// What the run directory says.
    pub report: Report,
}

impl Ended {
    /// The exit status: that of the capture, and of a capture that was carried out whether its result can be used.
    pub fn status(&self) -> Status {
        match (Status::from(&self.outcome), self.report.verdict) {
            (Status::Done, Verdict::Bad) => Status::Unusable,
            (status, _) => status,
        }
    }
}

/// Carries out an order: opens the rig, plans from where its arms stand, captures into a new run directory under
/// `out`, and writes everything that follows from the readings.
///
/// All that can be wrong with files, specimen, directory, port and devices is found before a run directory is made
/// and before anything moves.
///
/// # Errors
/// What is wrong with them; a journal that cannot be written any more (what it holds is safe); a report that cannot
/// be written (`reconstruct` makes it again).
pub async fn run(
    order: &RunRequest,
    out: &Path,
    control: watch::Receiver<Command>,
    on_event: &mut (dyn FnMut(Event) + Send),
) -> Result<Ended, SessionError> {
    // A job that this rig can never do need not wait for the rig to answer.
    order.plan(None)?;
    let now = SystemTime::now();
    order.certificate(now)?;
    prepare_output(out)?;
    let mut station = OpenRig::open(&order.rig, &order.rig_name)?;
    let start = station.start().await?;
    let plan = order.plan(Some(start))?;
    let id = ulid::Ulid::generate();
    let header = order.header(plan, &id, now)?;
    let directory = RunDirectory::at(out.join(run_directory_name(now, &id)));
    fs::create_dir(directory.path()).map_err(unwritable(out))?;
    let mut journal = FileJournal::create(directory.journal(), header)?;
    finish(
        directory,
        &order.job,
        &mut station,
        &mut journal,
        control,
        on_event,
    )
    .await
}

/// Goes on with a run that was interrupted; a run that is done already is only reported again. `rig` is a rig file that
/// says where the rig is now, where that has changed; see [`RunRequest::resumed_on`].
///
/// # Errors
/// As [`run`]; and a directory that holds no run, or a rig file of another rig.
pub async fn resume(
    directory: &Path,
    rig: Option<&Path>,
    control: watch::Receiver<Command>,
    on_event: &mut (dyn FnMut(Event) + Send),
) -> Result<Ended, SessionError> {
    let directory = RunDirectory::at(directory);
    let mut journal = FileJournal::open(directory.journal())?;
    let Some(Record::Header(header)) = journal.records().first() else {
        return Err(capture::CaptureError::NoHeader.into());
    };
    if report::Run::new(header, journal.records()).complete() {
        let report = report::write(&directory, journal.records())?;
        return Ok(Ended {
            directory,
            outcome: Outcome::Done,
            report,
        });
    }
    let order = match rig {
        Some(rig) => RunRequest::resumed_on(header, rig)?,
        None => RunRequest::resumed(header)?,
    };
    let mut station = OpenRig::open(&order.rig, &order.rig_name)?;
    finish(
        directory,
        &order.job,
        &mut station,
        &mut journal,
        control,
        on_event,
    )
    .await
}

async fn finish(
    directory: RunDirectory,
    job: &Job,
    station: &mut OpenRig,
    journal: &mut FileJournal,
    control: watch::Receiver<Command>,
    on_event: &mut (dyn FnMut(Event) + Send),
) -> Result<Ended, SessionError> {
    let mut ask = extension_planner(job.clone(), station.drive.file().clone());
    let outcome = capture::run_and_ask(&mut station.drive, journal, control, on_event, &mut ask).await?;
    let report = report::write(&directory, journal.records())?;
    Ok(Ended {
        directory,
        outcome,
        report,
    })
}

/// Asks a job what is measured next, on a thread of its own. Should that panic, nothing more is measured, and what was is
/// kept.
pub fn extension_planner(job: Job, rig: RigFile) -> impl FnMut(&[Record]) -> Thinking + Send {
    move |records| {
        let (job, rig, records) = (job.clone(), rig.clone(), records.to_vec());
        let thinking = tokio::task::spawn_blocking(move || report::extension(&job, &records, &rig));
        Box::pin(async move {
            thinking.await.unwrap_or_else(|error| Extension {
                steps: Vec::new(),
                why: format!("nothing is added: {error}"),
                expected_male: None,
            })
        })
    }
}

/// Makes the directory of the run directories and tries whether it can be written.
///
/// # Errors
/// It cannot be made or written.
pub fn prepare_output(out: &Path) -> Result<(), SessionError> {
    fs::create_dir_all(out).map_err(unwritable(out))?;
    let probe = out.join(format!(".writable-{}", std::process::id()));
    let tried = fs::File::create(&probe).and_then(|mut file| file.write_all(b"1"));
    let removed = fs::remove_file(&probe);
    tried.and(removed).map_err(unwritable(out))
}

pub(crate) fn unwritable(path: &Path) -> impl Fn(std::io::Error) -> SessionError {
    move |source| SessionError::Out {
        path: PathBuf::from(path),
        source,
    }
}

/// Name of a run directory: when it began, so that a listing is in order, and its id.
pub fn run_directory_name(began: SystemTime, id: &ulid::Ulid) -> String {
    let time = humantime::format_rfc3339_seconds(began).to_string();
    let time = time.replace([':', '-'], "").replace('T', "-");
    format!("{}-{id}", time.trim_end_matches('Z'))
}
