use arms::Pose;
use capture::{Command, Journal, Outcome, Record};
use report::{RunDirectory, Volume};

use super::observer::Observer;
use super::{RigWorker, gone, stopped};
use crate::operator::Permit;
use crate::queue::{Ending, WorkerEvent};
use crate::refusal::chain;
use crate::store::StoreJournal;
use crate::{Activity, DaemonError, FaultCode, Job, RecordView, RigSource, RunView, view};
use session::{RunRequest, SessionError, is_disk_full};

/// How a capture ended, and the fault that ended it.
type Captured = (Outcome, Option<FaultCode>);

const STOPPED: &str = "stopped; the readings so far are safe";

impl<S: RigSource> RigWorker<S> {
    /// Runs a job, or goes on with its run. A fault that ends it is latched before the permit ends.
    pub(super) async fn run_job(&mut self, job: &Job, permit: Permit) -> Ending {
        let result = self.try_job(job, &permit).await;
        let (ending, fault) = match result {
            Ok((Outcome::Done, _)) => (Ending::Done, None),
            Ok((Outcome::Stopped, _)) => (
                Ending::Interrupted {
                    why: STOPPED.to_owned(),
                },
                None,
            ),
            // Without a fault of the rig it is the emergency stop, which is latched since it was pressed.
            Ok((Outcome::Failed { fault: why }, code)) => (Ending::Interrupted { why }, code),
            Err(error) => {
                if gone(&error) {
                    self.rig = None;
                }
                ending(&error)
            }
        };
        if fault == Some(FaultCode::Disconnected) {
            self.rig = None;
        }
        if let (Some(code), Ending::Interrupted { why }) = (fault, &ending) {
            self.latch(code, why.clone());
        }
        drop(permit);
        ending
    }

    async fn try_job(&mut self, job: &Job, permit: &Permit) -> Result<Captured, DaemonError> {
        let run = match &job.run {
            Some(run) => run.clone(),
            None => match self.begin(job, permit).await? {
                Some(run) => run,
                None => return Ok((Outcome::Stopped, None)),
            },
        };
        let store = self.shared.store.clone();
        let mut journal = self.attend(StoreJournal::open(store, &run)).await?;
        let Some(Record::Header(header)) = journal.records().first() else {
            return Err(capture::CaptureError::NoHeader.into());
        };
        session::same_rig(header, &self.shared.rig)?;
        let captured = match report::Run::new(header, journal.records()).complete() {
            true => (Outcome::Done, None),
            false => self.capture(&run, &mut journal, permit).await?,
        };
        permit.release();
        self.shared.activity(Activity::Reporting);
        let volume = match job.whole {
            true => Volume::Whole,
            false => Volume::WithoutLarge,
        };
        self.write_report(&run, journal.records().to_vec(), volume)
            .await?;
        Ok(captured)
    }

    /// Plans a job from where the arms stand and begins its run. `None` where it was stopped before.
    async fn begin(&mut self, job: &Job, permit: &Permit) -> Result<Option<String>, DaemonError> {
        let shared = self.shared.clone();
        let settings = &shared.settings;
        let order = RunRequest::parse(
            job.text.clone(),
            &job.name,
            settings.rig.clone(),
            settings.rig_name.as_ref(),
        )?;
        let record = record(&order.job, &job.by);
        self.shared.activity(Activity::Identifying);
        let mut command = permit.command();
        let start = tokio::select! {
            biased;
            _ = stopped(&mut command) => return Ok(None),
            start = self.identify() => start?,
        };
        let id = ulid::Ulid::generate();
        let now = self.shared.time();
        let planned = tokio::task::spawn_blocking(move || {
            let plan = order.plan(Some(start))?;
            order.header(plan, &id, now)
        });
        let header = self.attend(planned).await.map_err(DaemonError::Planning)??;
        let mut run = RunView {
            id: id.to_string(),
            place: 0,
            job: job.id,
            state: job.state,
            record,
            archived: None,
            name: job.name.clone(),
            specimen: job.specimen.clone(),
            directory: self.shared.runs().join(session::run_directory_name(now, &id)),
            started: humantime::format_rfc3339_seconds(now).to_string(),
            reported: None,
            verdict: None,
            planned: header.plan.steps.len() as u64,
            accepted: 0,
        };
        if permit.now() != Command::Run {
            return Ok(None);
        }
        let header = Record::Header(header);
        self.attend(shared.store.begin_run(&mut run, &header)).await?;
        self.report(WorkerEvent::Begun { run: run.id.clone() }).await;
        Ok(Some(run.id))
    }

    /// Asks every device who it is and where it stands; moves nothing.
    async fn identify(&mut self) -> Result<Pose, DaemonError> {
        Ok(self.open()?.start().await?)
    }

    async fn capture(
        &mut self,
        run: &str,
        journal: &mut StoreJournal,
        permit: &Permit,
    ) -> Result<Captured, DaemonError> {
        let shared = self.shared.clone();
        let Some(Record::Header(header)) = journal.records().first() else {
            return Err(capture::CaptureError::NoHeader.into());
        };
        let mut ask = session::extension_planner(RunRequest::resumed(header)?.job, shared.rig.clone());
        let mut observer = Observer::new(shared.clone(), permit, run, journal.records());
        let drive = &mut self.open()?.drive;
        let mut on_event = |event| observer.see(event);
        let outcome = capture::run_and_ask(drive, journal, permit.command(), &mut on_event, &mut ask).await;
        shared.view.send_modify(|view| view.lamp = false);
        Ok((outcome?, observer.fault))
    }

    /// Writes the run directory. An emergency stop is carried out meanwhile.
    async fn write_report(
        &mut self,
        run: &str,
        records: Vec<Record>,
        volume: Volume,
    ) -> Result<(), DaemonError> {
        let shared = self.shared.clone();
        let Some(view) = self.attend(shared.store.run(run)).await? else {
            return Ok(());
        };
        let directory = RunDirectory::at(&view.directory);
        let writing = tokio::task::spawn_blocking(move || crate::daemon::write(&directory, &records, volume));
        // A report that panics costs no measurement and not the thread of the rig.
        let report = self
            .attend(writing)
            .await
            .map_err(|panic| report::ReportError::Write {
                path: view.directory,
                source: std::io::Error::other(panic),
            })??;
        let now = shared.now();
        let verdict = view::verdict(report.verdict);
        self.attend(shared.store.reported(run, &now, verdict)).await?;
        self.report(WorkerEvent::Reported { verdict }).await;
        Ok(())
    }
}

/// What a job says of its run for the record; who submitted it has measured where it does not say.
fn record(job: &sweep::Job, by: &str) -> RecordView {
    let specimen = &job.specimen;
    RecordView {
        specimen_id: specimen.id.clone(),
        material: specimen.material.clone(),
        tags: specimen.tags.clone(),
        notes: specimen.notes.clone(),
        operator: match job.operator.as_str() {
            "" => by.to_owned(),
            operator => operator.to_owned(),
        },
        project: job.project.clone(),
        ..RecordView::default()
    }
}

/// What an error makes of a job, and the fault that it is.
fn ending(error: &DaemonError) -> (Ending, Option<FaultCode>) {
    let why = chain(error);
    let fault = match error {
        DaemonError::Session(SessionError::Job(sweep::SweepError::Start { .. })) => FaultCode::Refused,
        DaemonError::Session(SessionError::Job(_) | SessionError::Rig(_)) => {
            return (Ending::Failed { why }, None);
        }
        DaemonError::Session(SessionError::NotReady { kind, .. }) => view::fault_code(*kind),
        DaemonError::Session(SessionError::Port { source, .. }) => {
            view::fault_code(rig::Fault::kind(source.as_ref()))
        }
        DaemonError::Store(error) => error.code(),
        DaemonError::Session(
            SessionError::Journal(error) | SessionError::Capture(capture::CaptureError::Journal(error)),
        ) => store_code(error),
        DaemonError::Session(SessionError::Capture(_) | SessionError::OtherRig { .. }) => FaultCode::Mismatch,
        error if is_disk_full(error) => FaultCode::DiskFull,
        DaemonError::Session(SessionError::Report(_)) => FaultCode::Report,
        _ => FaultCode::Setup,
    };
    (Ending::Interrupted { why }, Some(fault))
}

fn store_code(error: &capture::JournalError) -> FaultCode {
    let source = match error {
        capture::JournalError::Store { source, .. } => source.downcast_ref::<crate::StoreError>(),
        _ => None,
    };
    source.map_or(FaultCode::Store, crate::StoreError::code)
}
