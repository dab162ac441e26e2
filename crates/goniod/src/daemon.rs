use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

use arms::{Arm, ArmAngle};
use capture::{Command, FileJournal, Record};
use formats::Format;
use report::{RunDirectory, RunExport, Volume};
use rig::RigFile;
use tokio::sync::{mpsc, oneshot, watch};

mod runs;

use crate::audit::Audit;
use crate::event::Log;
use crate::history;
use crate::lock::Lock;
use crate::operator::{NotKept, OperatorControl};
use crate::queue::{Queue, Request};
use crate::refusal::chain;
use crate::shared::Shared;
use crate::strays::RunDirectories;
use crate::worker::{RigWorker, WorkerPlace};
use crate::{
    Action, Caller, DaemonError, Event, Events, FaultId, Job, JobId, PlanView, PortOfFile, ReadingView,
    Refusal, RefusalKind, RigSource, RigView, RunView, Sqlite, Store, Submission,
};
use session::RunRequest;

/// Name of the store in the data folder.
pub(crate) const STORE: &str = "goniod.db";
/// Requests that may wait for the queue; a further one is refused.
const REQUESTS: usize = 64;
/// Events of the worker that may wait for the queue.
const WORKER_EVENTS: usize = 8;
/// Most bytes of a job file.
const JOB_BYTES: usize = 64 * 1024;
/// Ids of events in one life of the daemon.
const EVENTS_PER_LIFE: u64 = 1 << 32;

/// What a daemon is opened with.
#[derive(Clone)]
pub struct Settings {
    /// Text of the rig file.
    pub rig: String,
    /// What messages call the rig file.
    pub rig_name: String,
    /// Folder of the store and of the run directories; made where it is missing.
    pub data: PathBuf,
    /// The wall clock; what it says is only ever shown.
    pub clock: fn() -> SystemTime,
}

/// The service: a queue of jobs, one rig that works it off, and an operator who can stop it.
///
/// Handles are cheap to clone. One task owns the queue, one thread the rig. Whatever is asked is answered in bounded
/// time, or refused; pause, stop and emergency stop wait for nothing.
#[derive(Clone)]
pub struct Daemon {
    shared: Arc<Shared>,
    requests: mpsc::Sender<Request>,
    ended: watch::Receiver<bool>,
}

impl Daemon {
    /// Opens the store and the rig. Runs that were under way when the program ended are marked as interrupted and wait
    /// for an operator; nothing moves.
    ///
    /// A rig that does not answer is no error: it is looked for again and again.
    ///
    /// # Errors
    /// A rig file that is wrong; a data folder that cannot be written, or is in use; a store that cannot be opened, is
    /// damaged, or does not know run directories that lie beside it; a port that another program has.
    pub async fn open(settings: Settings) -> Result<Self, DaemonError> {
        session::prepare_output(&settings.data)?;
        let lock = Lock::take(&settings.data)?;
        let path = settings.data.join(STORE);
        let runs = RunDirectories::of(&settings.data)?;
        runs.check_file(&path)?;
        let store = Sqlite::open(&path).await?;
        if let Err(error) = runs.check_store(&path, &store).await {
            store.close().await;
            return Err(error);
        }
        Self::start(settings, Arc::new(store), lock, PortOfFile, WorkerPlace::Thread).await
    }

    /// As [`Self::open`], with a store and a rig of the caller's, and the worker where the caller wants it.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub async fn open_with(
        settings: Settings,
        store: Arc<dyn Store>,
        source: impl RigSource,
        place: WorkerPlace,
    ) -> Result<Self, DaemonError> {
        session::prepare_output(&settings.data)?;
        let lock = Lock::take(&settings.data)?;
        Self::start(settings, store, lock, source, place).await
    }

    async fn start(
        settings: Settings,
        store: Arc<dyn Store>,
        lock: Lock,
        source: impl RigSource,
        place: WorkerPlace,
    ) -> Result<Self, DaemonError> {
        let rig = RigFile::parse(&settings.rig, settings.rig_name.as_ref())?;
        let now = humantime::format_rfc3339_millis((settings.clock)()).to_string();
        let life = store.begin_life(&now).await?;
        let latched = store.latched().await?;
        runs::clear(&settings.data);
        let view = watch::Sender::new(crate::view::unknown_rig(&rig));
        let log = Arc::new(Log::new(life * EVENTS_PER_LIFE));
        let operator = OperatorControl::open(
            &settings.data,
            || latched,
            view.clone(),
            log.clone(),
            settings.clock,
        );
        let shared = Arc::new(Shared {
            audit: Audit::start(store.clone()),
            settings,
            store,
            operator,
            view,
            log,
            holding: watch::Sender::new(false),
            unkept: Mutex::default(),
            making: tokio::sync::Mutex::default(),
            rig,
        });
        let (requests, asked) = mpsc::channel(REQUESTS);
        let (reported, events) = mpsc::channel(WORKER_EVENTS);
        let worker = RigWorker::start(shared.clone(), source, place, reported)?;
        let queue = Queue::open(shared.clone(), worker, lock).await?;
        let (end, ended) = watch::channel(false);
        tokio::spawn(queue.run(asked, events, end));
        Ok(Self {
            shared,
            requests,
            ended,
        })
    }

    /// What the handles, the queue and the worker share.
    pub(crate) fn shared(&self) -> &Shared {
        &self.shared
    }

    /// Queues a job.
    ///
    /// # Errors
    /// A job file that is wrong, or that this rig cannot do; too many waiting.
    pub async fn submit(&self, by: &Caller, submission: Submission) -> Result<Job, Refusal> {
        let receipt = self.shared.operator.receive();
        let whole = submission.whole;
        let order = self.order(submission.job, submission.name).await?;
        self.ask(by, |reply| Request::Submit {
            order: Box::new(order),
            whole,
            receipt,
            reply,
        })
        .await
    }

    /// What would be done for a job file; touches nothing.
    ///
    /// # Errors
    /// A job file that is wrong, or that this rig cannot do.
    pub async fn plan(&self, job: &str) -> Result<PlanView, Refusal> {
        let order = self.order(job.to_owned(), "job file".to_owned()).await?;
        blocking(move || {
            let plan = order.plan(None)?;
            Ok(crate::view::plan(&plan, order.light(&plan)))
        })
        .await?
        .map_err(|error: DaemonError| Refusal::invalid(&error))
    }

    /// Reads a job file and checks that this rig can do it.
    async fn order(&self, job: String, name: String) -> Result<RunRequest, Refusal> {
        if job.len() > JOB_BYTES {
            return Err(Refusal::new(
                RefusalKind::Invalid,
                format!("the job file has {} bytes, allowed are {JOB_BYTES}", job.len()),
            ));
        }
        let shared = self.shared.clone();
        blocking(move || {
            let order = RunRequest::parse(
                job,
                &name,
                shared.settings.rig.clone(),
                shared.settings.rig_name.as_ref(),
            )?;
            order.plan(None)?;
            Ok(order)
        })
        .await?
        .map_err(|error: DaemonError| Refusal::invalid(&error))
    }

    /// Jobs that are not over in the order of the queue, then the latest that are.
    ///
    /// # Errors
    /// The store cannot be read.
    pub async fn jobs(&self) -> Result<Vec<Job>, Refusal> {
        let mut jobs = self.waiting_jobs().await?;
        jobs.extend(self.jobs_over(None, history::USUAL).await?);
        Ok(jobs)
    }

    /// Jobs that are not over, in the order of the queue.
    ///
    /// # Errors
    /// The store cannot be read.
    pub async fn waiting_jobs(&self) -> Result<Vec<Job>, Refusal> {
        let jobs = self.shared.store.waiting_jobs().await?;
        Ok(jobs.into_iter().map(|job| self.shared.latest(job)).collect())
    }

    /// The latest so many jobs that are over, of those before a place where one is named, the latest first.
    ///
    /// # Errors
    /// More than 200, or none, are wanted; the store cannot be read.
    pub async fn jobs_over(&self, before: Option<u64>, most: u32) -> Result<Vec<Job>, Refusal> {
        history::limit(most)?;
        let jobs = self.shared.store.jobs_over(before, most).await?;
        Ok(jobs.into_iter().map(|job| self.shared.latest(job)).collect())
    }

    /// One job.
    ///
    /// # Errors
    /// There is none of that id; the store cannot be read.
    pub async fn job(&self, id: JobId) -> Result<Job, Refusal> {
        let job = self.shared.store.job(id).await?;
        job.map(|job| self.shared.latest(job))
            .ok_or_else(|| Refusal::new(RefusalKind::NotFound, format!("there is no job {id}")))
    }

    /// Starts, gives up or goes on with a job.
    ///
    /// # Errors
    /// No such job; not in its state; a fault is latched, or the rig is busy.
    pub async fn act(&self, by: &Caller, id: JobId, action: Action) -> Result<Job, Refusal> {
        let receipt = self.shared.operator.receive();
        self.ask(by, |reply| Request::Act {
            id,
            action,
            receipt,
            reply,
        })
        .await
    }

    /// Finishes the reading and holds, lamp on.
    ///
    /// # Errors
    /// Nothing is under way.
    pub async fn pause(&self, by: &Caller) -> Result<(), Refusal> {
        let result = self.shared.operator.pause();
        self.note(by, "pause", &result);
        result
    }

    /// Goes on after a pause.
    ///
    /// # Errors
    /// Nothing is paused.
    pub async fn proceed(&self, by: &Caller) -> Result<(), Refusal> {
        let result = self.shared.operator.proceed();
        self.note(by, "go on", &result);
        result
    }

    /// Finishes the reading, holds the arms, lamp off, and ends the run; it can be resumed. Holds the queue as
    /// [`Self::stop`] does. Never refused.
    ///
    /// # Errors
    /// As [`Self::stop`].
    pub async fn finish(&self, by: &Caller) -> Result<(), Refusal> {
        self.stop_by(by, "finish", Command::Finish).await
    }

    /// Decelerates now on the profiles, holds, and ends the run; it can be resumed. Nothing starts after it but what is
    /// asked for after its answer, and no job starts by itself until an operator starts or resumes one. Never refused.
    ///
    /// # Errors
    /// The arms stop and the queue is held, but that could not be written to disk: it is forgotten when the program
    /// ends.
    pub async fn stop(&self, by: &Caller) -> Result<(), Refusal> {
        self.stop_by(by, "stop", Command::Stop).await
    }

    async fn stop_by(&self, by: &Caller, word: &str, command: Command) -> Result<(), Refusal> {
        let result = self.shared.operator.stop(command).await.map_err(not_kept);
        self.note(by, word, &result);
        result
    }

    /// Stops the arms at once as the rig file says, lamp off. Nothing moves until it is acknowledged by the id that is
    /// returned, not after a restart either. Every press has an id of its own. Never refused.
    ///
    /// # Errors
    /// The arms stop and the fault is latched, but that could not be written to disk: it is forgotten when the program
    /// ends.
    pub async fn estop(&self, by: &Caller) -> Result<FaultId, Refusal> {
        let result = self.shared.operator.emergency_stop(by).await.map_err(not_kept);
        self.note(by, "emergency stop", &result);
        result
    }

    /// Acknowledges the newest latched fault by its id. The rig may move again once none is latched; nothing starts by
    /// that.
    ///
    /// # Errors
    /// None is latched; another one is newer, which the refusal has with it; the rig is still coming to rest.
    pub async fn acknowledge(&self, by: &Caller, fault: &FaultId) -> Result<(), Refusal> {
        let result = self.shared.operator.acknowledge(by, fault).await.map(drop);
        self.note(by, &format!("acknowledge {fault}"), &result);
        result
    }

    /// Moves one arm by hand; the other stays. Returns once the motion was checked and begins.
    ///
    /// # Errors
    /// A job is under way, a fault is latched, the rig does not answer, the motion would leave the envelope; the rig was
    /// stopped since this was asked for.
    pub async fn jog(&self, by: &Caller, arm: Arm, angle: ArmAngle) -> Result<(), Refusal> {
        self.travel(by, Some((arm, angle))).await
    }

    /// Takes both arms to rest, where the rig file parks them. Returns once the motion was checked and begins.
    ///
    /// # Errors
    /// As [`Self::jog`].
    pub async fn park(&self, by: &Caller) -> Result<(), Refusal> {
        self.travel(by, None).await
    }

    async fn travel(&self, by: &Caller, to: Option<(Arm, ArmAngle)>) -> Result<(), Refusal> {
        let receipt = self.shared.operator.receive();
        self.ask(by, |reply| Request::Move { to, receipt, reply }).await
    }

    /// Live picture of the rig.
    pub fn rig(&self) -> watch::Receiver<RigView> {
        self.shared.view.subscribe()
    }

    /// Text of the rig file.
    pub fn rig_file(&self) -> &str {
        &self.shared.settings.rig
    }

    /// Events as they happen: those after an id, as far as they are kept, or from now on.
    pub fn events(&self, after: Option<u64>) -> Events {
        Events::new(self.shared.log.clone(), after)
    }

    /// The latest so many events that are worth telling later, oldest first: what became of jobs, warnings, faults; of
    /// this start of the daemon.
    pub fn latest_events(&self, most: usize) -> Vec<Event> {
        self.shared.log.latest(most)
    }

    /// One run.
    ///
    /// # Errors
    /// There is none of that id; the store cannot be read.
    pub async fn run(&self, id: &str) -> Result<RunView, Refusal> {
        let run = self.shared.store.run(id).await?;
        run.ok_or_else(|| Refusal::new(RefusalKind::NotFound, format!("there is no run {id}")))
    }

    /// Every reading of a run, as far as it is.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub async fn readings(&self, id: &str) -> Result<Vec<ReadingView>, Refusal> {
        let records = self.records(id).await?;
        let shared = self.shared.clone();
        blocking(move || {
            let measured = report::measurements(&records, &shared.rig);
            measured.iter().map(crate::view::reading).collect()
        })
        .await
    }

    /// Makes a run's directory again from the store.
    ///
    /// # Errors
    /// As [`Self::run`]; files that cannot be written.
    pub async fn rebuild(&self, id: &str) -> Result<RunView, Refusal> {
        let directory = RunDirectory::at(self.run(id).await?.directory);
        let records = self.records(id).await?;
        let report = blocking(move || write(&directory, &records, Volume::Whole))
            .await?
            .map_err(|error| Refusal::unavailable(chain(&error)))?;
        let verdict = crate::view::verdict(report.verdict);
        self.shared
            .store
            .reported(id, &self.shared.now(), verdict)
            .await?;
        self.run(id).await
    }

    /// Makes the file of a run's result in a format, and its name.
    ///
    /// # Errors
    /// No such run or format; the run has no BRDF, or the format does not hold it.
    pub async fn export(&self, id: &str, format: &str) -> Result<(String, Vec<u8>), Refusal> {
        let format =
            Format::named(format).map_err(|error| Refusal::new(RefusalKind::NotFound, error.to_string()))?;
        let run = self.run_export(id).await?;
        let exported = blocking(move || {
            let exported = format.export(&run.export());
            exported.map(|exported| (run.file_name(format), exported.bytes))
        })
        .await?;
        exported.map_err(|error| Refusal::conflict(chain(&error)))
    }

    /// The result of a run with all that a file in some format can say of it.
    ///
    /// # Errors
    /// As [`Self::run`]; the run has no BRDF.
    pub async fn run_export(&self, id: &str) -> Result<RunExport, Refusal> {
        let records = self.records(id).await?;
        let run = blocking(move || RunExport::from_records(&records)).await?;
        run.map_err(|error| Refusal::conflict(chain(&error)))
    }

    async fn records(&self, id: &str) -> Result<Vec<Record>, Refusal> {
        let run = self.run(id).await?;
        Ok(self.shared.store.records(&run.id).await?)
    }

    /// Ends the service: the reading is finished, the arms hold, the lamp is off, the state is saved.
    pub async fn shutdown(&self) {
        self.shared.operator.close();
        // An error means that it has ended already.
        let _ = self.ended.clone().wait_for(|&ended| ended).await;
    }

    /// Notes what somebody asked past the queue, without waiting for that.
    fn note<T>(&self, by: &Caller, what: &str, result: &Result<T, Refusal>) {
        note(&self.shared, by, what, result);
    }

    async fn ask<T>(&self, by: &Caller, request: impl FnOnce(Reply<T>) -> Request) -> Result<T, Refusal> {
        let (answer, answered) = oneshot::channel();
        let ended = || Refusal::unavailable("the daemon is shutting down");
        let reply = Reply {
            by: by.clone(),
            answer,
        };
        self.requests
            .try_send(request(reply))
            .map_err(|error| match error {
                mpsc::error::TrySendError::Full(_) => {
                    Refusal::new(RefusalKind::Busy, "too many requests are waiting; try again")
                }
                mpsc::error::TrySendError::Closed(_) => ended(),
            })?;
        answered.await.map_err(|_| ended())?
    }
}

fn not_kept(NotKept(why): NotKept) -> Refusal {
    Refusal::unavailable(format!(
        "the arms stop and nothing moves until you say so, but only as long as the daemon runs: {why}"
    ))
}

/// Notes in the audit what was asked and what came of it.
fn note<T>(shared: &Shared, by: &Caller, what: &str, result: &Result<T, Refusal>) {
    let outcome = match result {
        Ok(_) => "done".to_owned(),
        Err(refusal) => refusal.to_string(),
    };
    shared.audit.note(shared.now(), &by.name, what, &outcome);
}

/// Who asked, and where the answer goes.
pub(crate) struct Reply<T> {
    pub(crate) by: Caller,
    answer: oneshot::Sender<Result<T, Refusal>>,
}

impl<T> Reply<T> {
    /// Notes what was asked and what came of it, and answers.
    pub(crate) fn send(self, shared: &Shared, what: &str, result: Result<T, Refusal>) {
        note(shared, &self.by, what, &result);
        // Whoever asked may have gone.
        let _ = self.answer.send(result);
    }
}

/// Writes a run directory from the records of its journal.
///
/// # Errors
/// A file that cannot be written; records that make no report.
pub(crate) fn write(
    directory: &RunDirectory,
    records: &[Record],
    volume: Volume,
) -> Result<report::Report, report::ReportError> {
    std::fs::create_dir_all(directory.path()).map_err(|source| report::ReportError::Write {
        path: directory.path().to_owned(),
        source,
    })?;
    directory.write("journal", |file| FileJournal::copy(records, file))?;
    report::write_volume(directory, records, volume)
}

async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Refusal> {
    let done = tokio::task::spawn_blocking(work).await;
    done.map_err(|error| Refusal::unavailable(error.to_string()))
}
