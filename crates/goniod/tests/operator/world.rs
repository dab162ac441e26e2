//! A daemon over simulated devices that outlive it, under a paused clock.

use std::cell::Cell;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};

use arms::{Arm, ArmAngle};
use firmware_sim::in_process::{InProcessRig, SharedBench};
use firmware_sim::{Disturbance, Fault};
use goniod::{
    Action, Behaviour, Caller, Daemon, FaultId, JobId, JobState, Memory, OpenRig, RigSource, Settings,
    Submission, WorkerPlace,
};
use rig::{Drive, RigFile};
use session::SessionError;
use tempfile::TempDir;

use crate::law::{Mark, What};
use crate::script::{Delay, Op, Script};

/// Long enough to be under way as long as anybody looks.
const JOB: &str = "on_stage = true\n[[plane]]\ntheta_r_deg = 60\nreadings = 200\n";

/// For how long a device that falls silent hears nothing.
const SILENCE: Duration = Duration::from_millis(300);

/// How long everything is left alone at the end.
const SETTLE: Duration = Duration::from_secs(4);

/// The rig file and the devices, which stay when the program goes.
pub(crate) struct World {
    folder: TempDir,
    file: RigFile,
    store: Arc<Memory>,
    bench: Option<SharedBench>,
    marks: Arc<Mutex<Vec<Mark>>>,
    asked: Cell<usize>,
}

/// A folder for which no disk is waited for, where the system has one: each script syncs several times.
fn in_memory() -> TempDir {
    let memory = Path::new("/dev/shm");
    match memory.is_dir() {
        true => TempDir::new_in(memory).unwrap(),
        false => TempDir::new().unwrap(),
    }
}

/// Hands out the rig over the one bench.
struct Bench(SharedBench);

impl RigSource for Bench {
    type Rig = InProcessRig;

    fn open(&self, file: &RigFile, _: &str) -> Result<OpenRig<InProcessRig>, SessionError> {
        Ok(OpenRig::without_port(Drive::new(self.0.rig(file), file.clone())))
    }
}

impl World {
    pub(crate) fn new() -> Self {
        Self {
            folder: in_memory(),
            file: RigFile::parse("", "rig.toml".as_ref()).unwrap(),
            store: Arc::new(Memory::new()),
            bench: None,
            marks: Arc::default(),
            asked: Cell::new(0),
        }
    }

    /// Lets everything of a script happen; returns what the devices were told and what happened when.
    pub(crate) fn play(mut self, script: &Script) -> (SharedBench, Vec<Mark>) {
        let mut left = script.as_slice();
        loop {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .start_paused(true)
                .build()
                .unwrap();
            let restart = runtime.block_on(self.live(left));
            // The program is killed: whatever waits is gone, and nobody answers any more.
            drop(runtime);
            match restart {
                Some(rest) => left = rest,
                None => break,
            }
        }
        let marks = std::mem::take(&mut *self.marks.lock().unwrap());
        (self.bench.expect("it lived"), marks)
    }

    /// Starts the program; returns once it knows the rig.
    pub(crate) async fn open(&mut self) -> (Daemon, SharedBench) {
        let file = &self.file;
        let bench = self.bench.get_or_insert_with(|| {
            let bench = InProcessRig::new(file).unwrap().bench();
            bench.keep_writes();
            bench
        });
        let bench = bench.clone();
        // A store that is out of order when the program starts keeps it from starting at all.
        self.store.behave(Behaviour::Prompt);
        let settings = Settings {
            rig: String::new(),
            rig_name: "rig.toml".to_owned(),
            data: self.folder.path().join("data"),
            clock: SystemTime::now,
        };
        let source = Bench(bench.clone());
        let daemon = Daemon::open_with(settings, self.store.clone(), source, WorkerPlace::Task)
            .await
            .unwrap();
        let mut rig = daemon.rig();
        rig.wait_for(|rig| rig.connected).await.unwrap();
        drop(rig);
        (daemon, bench)
    }

    pub(crate) fn store(&self) -> &Memory {
        &self.store
    }

    /// One life of the daemon. Returns what is left to happen in the next one.
    async fn live<'a>(&mut self, script: &'a [(Op, Delay)]) -> Option<&'a [(Op, Delay)]> {
        let (daemon, _) = self.open().await;
        for (i, &(op, delay)) in script.iter().enumerate() {
            if op == Op::Restart {
                return Some(&script[i + 1..]);
            }
            self.happen(&daemon, op);
            match delay {
                Delay::Turns(turns) => {
                    for _ in 0..turns {
                        tokio::task::yield_now().await;
                    }
                }
                Delay::Time(time) => tokio::time::sleep(time).await,
            }
        }
        // Whatever was held up comes through now, if it comes at all.
        self.store.behave(Behaviour::Prompt);
        tokio::time::sleep(SETTLE).await;
        None
    }

    /// Has one thing happen, and notes when it was asked for and when it was answered.
    fn happen(&self, daemon: &Daemon, op: Op) {
        let bench = self.bench.clone().expect("it lives");
        match op {
            Op::StorePaused => return self.store.behave(Behaviour::Paused),
            Op::StoreFailing => return self.store.behave(Behaviour::Failing),
            Op::StorePrompt => return self.store.behave(Behaviour::Prompt),
            Op::DeviceSilent => {
                self.marks.lock().unwrap().push(Mark {
                    writes: bench.write_count(),
                    at: bench.now(),
                    pose: bench.pose(),
                    number: usize::MAX,
                    what: What::Silenced(SILENCE),
                });
                return bench.schedule(Fault {
                    device: rig::Device::Sensor,
                    at: Duration::ZERO,
                    what: Disturbance::Silence(SILENCE),
                });
            }
            _ => {}
        }
        let (daemon, marks) = (daemon.clone(), self.marks.clone());
        let named = daemon.rig().borrow().fault.as_ref().map(|fault| fault.id.clone());
        let number = self.asked.replace(self.asked.get() + 1);
        let mark = move |what| {
            let pose = bench.pose();
            marks.lock().unwrap().push(Mark {
                writes: bench.write_count(),
                at: bench.now(),
                pose,
                number,
                what,
            });
        };
        tokio::spawn(async move {
            // Which job is meant is looked up first, by a request of its own that a store may hold up: the request that is
            // judged comes in after that.
            let job = chosen(&daemon, op).await;
            mark(What::Asked {
                op,
                fault: named.clone(),
            });
            let answer = ask(&daemon, op, named.clone(), job).await;
            mark(match answer {
                Ok(pressed) => What::Answered {
                    op,
                    fault: pressed.or(named),
                },
                Err(_) => What::Refused,
            });
        });
    }
}

/// The job that an operator means who starts, resumes or cancels one.
async fn chosen(daemon: &Daemon, op: Op) -> Option<JobId> {
    let fits = |state: JobState| match op {
        Op::Ready => matches!(state, JobState::Queued | JobState::AwaitingSpecimen),
        Op::Resume => state == JobState::Interrupted,
        Op::Cancel => !state.over(),
        _ => false,
    };
    if !matches!(op, Op::Ready | Op::Resume | Op::Cancel) {
        return None;
    }
    let jobs = daemon.jobs().await.ok()?;
    jobs.iter().find(|job| fits(job.state)).map(|job| job.id)
}

/// Asks; returns the fault that was latched by it. Where no job fits, nothing is asked.
async fn ask(
    daemon: &Daemon,
    op: Op,
    named: Option<FaultId>,
    job: Option<JobId>,
) -> Result<Option<FaultId>, String> {
    let by = Caller {
        name: "operator".to_owned(),
    };
    let done = match op {
        Op::Stop => daemon.stop(&by).await,
        Op::Estop => return daemon.estop(&by).await.map(Some).map_err(|refusal| refusal.why),
        Op::Pause => daemon.pause(&by).await,
        Op::Proceed => daemon.proceed(&by).await,
        Op::Finish => daemon.finish(&by).await,
        Op::Acknowledge => {
            let none = || FaultId::from("none".to_owned());
            daemon.acknowledge(&by, &named.unwrap_or_else(none)).await
        }
        Op::Submit => {
            let submission = Submission {
                job: JOB.to_owned(),
                name: "job.toml".to_owned(),
                whole: false,
            };
            daemon.submit(&by, submission).await.map(drop)
        }
        Op::Ready => act(daemon, &by, job, Action::Ready).await,
        Op::Resume => act(daemon, &by, job, Action::Resume).await,
        Op::Cancel => act(daemon, &by, job, Action::Cancel).await,
        Op::Jog => daemon.jog(&by, Arm::Light, ArmAngle::from_deg(-20.0)).await,
        Op::Park => daemon.park(&by).await,
        _ => unreachable!("it is asked of nobody"),
    };
    done.map(|()| None).map_err(|refusal| refusal.why)
}

async fn act(
    daemon: &Daemon,
    by: &Caller,
    job: Option<JobId>,
    action: Action,
) -> Result<(), goniod::Refusal> {
    match job {
        Some(job) => daemon.act(by, job, action).await.map(drop),
        None => Ok(()),
    }
}
