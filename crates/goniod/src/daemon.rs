use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

use arms::{Arm, ArmAngle};
use capture::{Command, FileJournal, Record};
use report::RunDirectory;
use rig::RigFile;
use tokio::sync::{mpsc, oneshot, watch};

use crate::event::Log;
use crate::hand::Hand;
use crate::lock::Lock;
use crate::queue::{Ask, News, Queue, Verb};
use crate::refusal::chain;
use crate::shared::Shared;
use crate::{
    Action, Activity, Caller, DaemonError, Events, Job, JobId, Order, PlanView, ReadingView, Refusal,
    RefusalKind, RigView, RunView, Sqlite, Store, Submission,
};

/// Requests that may wait for the queue; a further one is refused.
const ASKS: usize = 64;
/// Most jobs that are over, and most runs, in one answer.
const LISTED: u32 = 500;
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
    asks: mpsc::Sender<Ask>,
    news: mpsc::UnboundedSender<News>,
}

impl Daemon {
    /// Opens the store and the rig. Runs that were under way when the program ended are marked as interrupted and wait
    /// for an operator; nothing moves.
    ///
    /// A rig that does not answer is no error: it is looked for again and again.
    ///
    /// # Errors
    /// A rig file that is wrong; a data folder that cannot be written, or is in use; a store that cannot be opened; a
    /// port that another program has.
    pub async fn open(settings: Settings) -> Result<Self, DaemonError> {
        crate::run::prepare(&settings.data)?;
        let lock = Lock::take(&settings.data)?;
        let store = Sqlite::open(&settings.data.join("goniod.db")).await?;
        Self::start(settings, Arc::new(store), lock).await
    }

    async fn start(settings: Settings, store: Arc<dyn Store>, lock: Lock) -> Result<Self, DaemonError> {
        let rig = RigFile::parse(&settings.rig, settings.rig_name.as_ref())?;
        let now = humantime::format_rfc3339_millis((settings.clock)()).to_string();
        let life = store.begin_life(&now).await?;
        let mut view = crate::view::unknown_rig(&rig);
        view.fault = store.latched().await?;
        let shared = Arc::new(Shared {
            settings,
            store,
            command: watch::Sender::new(Command::Run),
            view: watch::Sender::new(view),
            log: Arc::new(Log::new(life * EVENTS_PER_LIFE)),
            unkept: Mutex::default(),
            rig,
        });
        let (asks, asked) = mpsc::channel(ASKS);
        let (news, told) = mpsc::unbounded_channel();
        let hand = Hand::start(shared.clone(), news.clone())?;
        let queue = Queue::open(shared.clone(), hand, lock).await?;
        tokio::spawn(queue.run(asked, told));
        Ok(Self { shared, asks, news })
    }

    /// Queues a job.
    ///
    /// # Errors
    /// A job file that is wrong, or that this rig cannot do; too many waiting.
    pub async fn submit(&self, by: &Caller, submission: Submission) -> Result<Job, Refusal> {
        let order = self.order(submission.job, submission.name).await?;
        self.ask(by, |reply| Ask::Submit {
            order: Box::new(order),
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
    async fn order(&self, job: String, name: String) -> Result<Order, Refusal> {
        if job.len() > JOB_BYTES {
            return Err(Refusal::new(
                RefusalKind::Invalid,
                format!("the job file has {} bytes, allowed are {JOB_BYTES}", job.len()),
            ));
        }
        let shared = self.shared.clone();
        blocking(move || {
            let order = Order::parse(
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
        let jobs = self.shared.store.jobs(LISTED).await?;
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
        self.ask(by, |reply| Ask::Act { id, action, reply }).await
    }

    /// Finishes the reading and holds, lamp on.
    ///
    /// # Errors
    /// Nothing is under way.
    pub async fn pause(&self, by: &Caller) -> Result<(), Refusal> {
        self.command(by, Verb::Pause, Command::Pause, |now| now == Command::Run)
    }

    /// Goes on after a pause.
    ///
    /// # Errors
    /// Nothing is paused.
    pub async fn proceed(&self, by: &Caller) -> Result<(), Refusal> {
        self.command(by, Verb::Proceed, Command::Run, |now| now == Command::Pause)
    }

    /// Finishes the reading, holds the arms, lamp off, and ends the run; it can be resumed.
    ///
    /// # Errors
    /// Nothing is under way.
    pub async fn finish(&self, by: &Caller) -> Result<(), Refusal> {
        self.command(by, Verb::Finish, Command::Finish, |now| {
            matches!(now, Command::Run | Command::Pause)
        })
    }

    /// Decelerates now on the profiles, holds, and ends the run; it can be resumed.
    ///
    /// # Errors
    /// Nothing is under way.
    pub async fn stop(&self, by: &Caller) -> Result<(), Refusal> {
        self.command(by, Verb::Stop, Command::Stop, |now| now != Command::Estop)
    }

    /// Stops the arms at once as the rig file says, lamp off. Nothing moves until it is acknowledged, not after a
    /// restart either. Never refused.
    ///
    /// # Errors
    /// None.
    pub async fn estop(&self, by: &Caller) -> Result<(), Refusal> {
        self.shared.command.send_replace(Command::Estop);
        self.say(by, Verb::Estop);
        Ok(())
    }

    /// Acknowledges the latched fault, so that the rig may move again. Nothing starts by that.
    ///
    /// # Errors
    /// None is latched; the store cannot be written.
    pub async fn acknowledge(&self, by: &Caller) -> Result<(), Refusal> {
        self.ask(by, |reply| Ask::Acknowledge { reply }).await
    }

    /// Moves one arm by hand; the other stays. Returns once the motion was checked and begins.
    ///
    /// # Errors
    /// A job is under way, a fault is latched, the rig does not answer, the motion would leave the envelope.
    pub async fn jog(&self, by: &Caller, arm: Arm, angle: ArmAngle) -> Result<(), Refusal> {
        self.ask(by, |reply| Ask::Move {
            to: Some((arm, angle)),
            reply,
        })
        .await
    }

    /// Takes both arms to rest, where the rig file parks them. Returns once the motion was checked and begins.
    ///
    /// # Errors
    /// As [`Self::jog`].
    pub async fn park(&self, by: &Caller) -> Result<(), Refusal> {
        self.ask(by, |reply| Ask::Move { to: None, reply }).await
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

    /// The latest runs, newest first.
    ///
    /// # Errors
    /// The store cannot be read.
    pub async fn runs(&self) -> Result<Vec<RunView>, Refusal> {
        Ok(self.shared.store.runs(LISTED).await?)
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
        blocking(move || write(&directory, &records))
            .await?
            .map_err(|error| Refusal::unavailable(chain(&error)))?;
        self.shared.store.reported(id, &self.shared.now()).await?;
        self.run(id).await
    }

    async fn records(&self, id: &str) -> Result<Vec<Record>, Refusal> {
        let run = self.run(id).await?;
        Ok(self.shared.store.records(&run.id).await?)
    }

    /// Ends the service: the reading is finished, the arms hold, the lamp is off, the state is saved.
    pub async fn shutdown(&self) {
        let (reply, ended) = oneshot::channel();
        if self.asks.send(Ask::Shutdown { reply }).await.is_ok() {
            // An error means that it has ended already.
            let _ = ended.await;
        }
    }

    /// Gives the capture a command, where the present one allows it.
    fn command(
        &self,
        by: &Caller,
        verb: Verb,
        command: Command,
        allowed: impl Fn(Command) -> bool,
    ) -> Result<(), Refusal> {
        let (job, activity) = {
            let view = self.shared.view.borrow();
            (view.job, view.activity)
        };
        if job.is_none() && activity == Activity::Idle {
            return Err(Refusal::conflict(format!(
                "nothing is under way that could {verb}"
            )));
        }
        let taken = self.shared.command.send_if_modified(|now| {
            let may = allowed(*now);
            if may {
                *now = command;
            }
            may
        });
        if !taken {
            let now = *self.shared.command.borrow();
            return Err(Refusal::conflict(format!("cannot {verb}: {now:?} was asked for")));
        }
        self.say(by, verb);
        Ok(())
    }

    /// Has a verb noted, without waiting for that.
    fn say(&self, by: &Caller, verb: Verb) {
        let said = News::Verb {
            by: by.name.clone(),
            verb,
        };
        // Nobody notes it any more once the queue has ended.
        let _ = self.news.send(said);
    }

    async fn ask<T>(&self, by: &Caller, ask: impl FnOnce(Reply<T>) -> Ask) -> Result<T, Refusal> {
        let (answer, answered) = oneshot::channel();
        let ended = || Refusal::unavailable("the daemon is shutting down");
        let reply = Reply {
            by: by.clone(),
            answer,
        };
        self.asks.try_send(ask(reply)).map_err(|error| match error {
            mpsc::error::TrySendError::Full(_) => {
                Refusal::new(RefusalKind::Busy, "too many requests are waiting; try again")
            }
            mpsc::error::TrySendError::Closed(_) => ended(),
        })?;
        answered.await.map_err(|_| ended())?
    }
}

/// Who asked, and where the answer goes.
pub(crate) struct Reply<T> {
    pub(crate) by: Caller,
    pub(crate) answer: oneshot::Sender<Result<T, Refusal>>,
}

/// Writes a run directory from the records of its journal.
///
/// # Errors
/// A file that cannot be written; records that make no report.
pub(crate) fn write(
    directory: &RunDirectory,
    records: &[Record],
) -> Result<report::Report, report::ReportError> {
    std::fs::create_dir_all(directory.path()).map_err(|source| report::ReportError::Write {
        path: directory.path().to_owned(),
        source,
    })?;
    directory.write("journal", |file| FileJournal::copy(records, file))?;
    report::write(directory, records)
}

async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Refusal> {
    let done = tokio::task::spawn_blocking(work).await;
    done.map_err(|error| Refusal::unavailable(error.to_string()))
}
