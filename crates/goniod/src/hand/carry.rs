use capture::{Header, Journal, Outcome, Record};
use report::RunDirectory;

use super::observer::Observer;
use super::{Hand, gone, pressed};
use crate::queue::{Ending, News};
use crate::refusal::chain;
use crate::store::StoreJournal;
use crate::{Activity, DaemonError, FaultCode, Job, Order, RunView, view};

/// How a capture ended, and the fault that ended it.
type Captured = (Outcome, Option<FaultCode>);

impl Hand {
    /// Carries a job through, or goes on with its run.
    pub(super) async fn carry(&mut self, job: &Job) -> Ending {
        let result = self.try_carry(job).await;
        let ending = match result {
            Ok((Outcome::Done, _)) => Ending::Done,
            Ok((Outcome::Stopped, _)) => Ending::Interrupted {
                why: "stopped; the readings so far are safe".to_owned(),
                fault: None,
            },
            Ok((Outcome::Failed { fault: why }, code)) => Ending::Interrupted {
                why,
                fault: Some(code.unwrap_or(FaultCode::Estop)),
            },
            Err(error) => {
                if gone(&error) {
                    self.station = None;
                }
                ending(&error)
            }
        };
        if let Ending::Interrupted {
            fault: Some(FaultCode::Disconnected),
            ..
        } = ending
        {
            self.station = None;
        }
        ending
    }

    async fn try_carry(&mut self, job: &Job) -> Result<Captured, DaemonError> {
        let run = match &job.run {
            Some(run) => run.clone(),
            None => self.begin(job).await?,
        };
        let mut journal = StoreJournal::open(self.shared.store.clone(), &run).await?;
        let Some(Record::Header(header)) = journal.records().first() else {
            return Err(capture::CaptureError::NoHeader.into());
        };
        self.same_rig(header)?;
        let captured = match report::Run::new(header, journal.records()).complete() {
            true => (Outcome::Done, None),
            false => self.capture(&run, &mut journal).await?,
        };
        self.shared.activity(Activity::Reporting);
        self.report(&run, journal.records().to_vec()).await?;
        Ok(captured)
    }

    /// Plans a job from where the arms stand and begins its run.
    async fn begin(&mut self, job: &Job) -> Result<String, DaemonError> {
        let settings = &self.shared.settings;
        let order = Order::parse(
            job.text.clone(),
            &job.name,
            settings.rig.clone(),
            settings.rig_name.as_ref(),
        )?;
        self.shared.activity(Activity::Identifying);
        let start = self.open()?.start().await?;
        let plan = order.plan(Some(start))?;
        let id = ulid::Ulid::generate();
        let now = self.shared.time();
        let run = RunView {
            id: id.to_string(),
            job: job.id,
            name: job.name.clone(),
            specimen: job.specimen.clone(),
            directory: self.shared.runs().join(crate::run::name(now, &id)),
            started: humantime::format_rfc3339_seconds(now).to_string(),
            reported: None,
            planned: plan.steps.len() as u64,
            accepted: 0,
        };
        let header = order.header(plan, &id, now)?;
        self.shared.store.begin_run(&run, &Record::Header(header)).await?;
        self.say(News::Begun { run: run.id.clone() });
        Ok(run.id)
    }

    /// A run goes on with the rig with which it began; only where that is connected may differ.
    fn same_rig(&self, header: &Header) -> Result<(), DaemonError> {
        let mut began = rig::RigFile::parse(&header.rig, "the run's rig file".as_ref())?;
        began.bus = self.shared.rig.bus.clone();
        began.sim = self.shared.rig.sim.clone();
        if began != self.shared.rig {
            return Err(DaemonError::OtherRig {
                run: header.run.clone(),
            });
        }
        Ok(())
    }

    async fn capture(&mut self, run: &str, journal: &mut StoreJournal) -> Result<Captured, DaemonError> {
        let (shared, news) = (self.shared.clone(), self.news.clone());
        let Some(Record::Header(header)) = journal.records().first() else {
            return Err(capture::CaptureError::NoHeader.into());
        };
        let mut ask = crate::run::ask(Order::resumed(header)?.job, shared.rig.clone());
        let mut observer = Observer::new(shared.clone(), news, run, journal.records());
        let fresh = self.station.is_none();
        self.open()?;
        if fresh {
            self.follow();
        }
        let control = shared.command.subscribe();
        let drive = &mut self.open()?.drive;
        let mut on_event = |event| observer.see(event);
        let outcome = capture::run_and_ask(drive, journal, control, &mut on_event, &mut ask).await;
        shared.view.send_modify(|view| view.lamp = false);
        Ok((outcome?, observer.fault))
    }

    /// Writes the run directory. An emergency stop is obeyed meanwhile.
    async fn report(&mut self, run: &str, records: Vec<Record>) -> Result<(), DaemonError> {
        let Some(view) = self.shared.store.run(run).await? else {
            return Ok(());
        };
        let directory = RunDirectory::at(&view.directory);
        let mut writing = tokio::task::spawn_blocking(move || crate::daemon::write(&directory, &records));
        let written = loop {
            tokio::select! {
                written = &mut writing => break written,
                () = pressed(&mut self.command) => self.halt().await,
            }
        };
        // A report that panics costs no measurement and not the thread of the rig.
        written.map_err(|panic| report::ReportError::Write {
            path: view.directory,
            source: std::io::Error::other(panic),
        })??;
        self.shared.store.reported(run, &self.shared.now()).await?;
        Ok(())
    }
}

/// What an error makes of a job.
fn ending(error: &DaemonError) -> Ending {
    let why = chain(error);
    let fault = match error {
        DaemonError::Job(sweep::SweepError::Start { .. }) => Some(FaultCode::Refused),
        DaemonError::Job(_) | DaemonError::Rig(_) => return Ending::Failed { why },
        DaemonError::NotReady(error) => Some(view::fault_code(error.kind())),
        DaemonError::Port { source, .. } => Some(view::fault_code(rig::Fault::kind(source.as_ref()))),
        DaemonError::Store(error) => Some(error.code()),
        DaemonError::Journal(error) => Some(store_code(error)),
        DaemonError::Capture(capture::CaptureError::Journal(error)) => Some(store_code(error)),
        DaemonError::Capture(_) | DaemonError::OtherRig { .. } => Some(FaultCode::Mismatch),
        error if error.disk_full() => Some(FaultCode::DiskFull),
        DaemonError::Report(_) => Some(FaultCode::Report),
        _ => Some(FaultCode::Setup),
    };
    Ending::Interrupted { why, fault }
}

fn store_code(error: &capture::JournalError) -> FaultCode {
    let source = match error {
        capture::JournalError::Store { source, .. } => source.downcast_ref::<crate::StoreError>(),
        _ => None,
    };
    source.map_or(FaultCode::Store, crate::StoreError::code)
}
