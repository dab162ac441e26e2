use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use capture::{Command, Header, Journal, JournalError, Outcome, Record};
use firmware_sim::in_process::{InProcessRig, SharedBench};
use firmware_sim::{Disturbance, Fault};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::dynamixel::register::{photometer, servo};
use rig::{Device, Drive, Rig, RigFile};
use sweep::Job;
use tokio::sync::watch;

/// A job of all kinds of steps, in seconds of rig time.
const JOB: &str = "[[plane]]\ntheta_r_deg = 60\nreadings = 8\n[arc]\nreadings = 5\n";
/// A diffuse specimen with a lobe.
const SPECIMEN: &str = "blue-rubber";
/// Seconds of rig time within which faults set in; a capture without any takes fewer.
const WITHIN_S: f64 = 6.0;
/// Executions after which a run must be complete: each fault ends one at most.
const MAX_EXECUTIONS: u32 = 8;
/// Simulated time in which one execution must end, come what may.
const HANG: Duration = Duration::from_secs(3600);
/// After this every silence, stall, watchdog and boot is over.
const REST: Duration = Duration::from_secs(12);
/// A reflectance that is further from the truth than so many of its expanded uncertainties is wrong: 6 σ.
const WRONG: f64 = 3.0;

/// Many captures on the in-process rig, each with a few random faults of its devices, from one seed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Campaign {
    /// How many.
    pub(crate) captures: u64,
    /// The first one's seed; the others follow.
    pub(crate) seed: u64,
}

/// What happens to one capture: enough to do it again.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Script {
    /// Seed of the capture.
    pub(crate) seed: u64,
    /// Faults, earliest first.
    pub(crate) faults: Vec<Trouble>,
}

/// One fault of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Trouble {
    /// Which device.
    pub(crate) device: Device,
    /// When, seconds of rig time since power-on.
    pub(crate) at_s: f64,
    /// What.
    pub(crate) what: Disturbance,
}

/// What a campaign found.
#[derive(Clone, Debug, Default)]
pub(crate) struct Campaigned {
    /// Captures that were carried through.
    pub(crate) captures: u64,
    /// Executions of all of them: one each, and one for each resumption.
    pub(crate) executions: u64,
    /// Faults that set in.
    pub(crate) faults: u64,
    /// Readings that were compared with the truth.
    pub(crate) readings: u64,
    /// Captures that went wrong: the script, cut down to what it takes, and what happened.
    pub(crate) wrong: Vec<(Script, String)>,
}

/// What one capture came to.
struct Carried {
    executions: u64,
    readings: u64,
}

impl std::fmt::Display for Script {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "seed {}", self.seed)?;
        for Trouble { device, at_s, what } in &self.faults {
            write!(f, "; {at_s} s {device} {what:?}")?;
        }
        Ok(())
    }
}

impl Campaign {
    /// Carries all captures out on as many threads as there are processors; `done` is told how many are.
    ///
    /// Each must end complete and true, or with a clear fault and in a safe state (lamp off, arms standing), from which
    /// it is resumed once the devices are switched off and on: no hang, no panic, no doubled or silently wrong reading.
    ///
    /// # Panics
    /// Never for what a capture does; where a thread cannot be started.
    pub(crate) fn run(&self, done: impl Fn(u64) + Sync) -> Campaigned {
        let (next, finished) = (AtomicU64::new(0), AtomicU64::new(0));
        let all = Mutex::new(Campaigned::default());
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    loop {
                        let i = next.fetch_add(1, Ordering::Relaxed);
                        if i >= self.captures {
                            break;
                        }
                        let script = Script::random(self.seed.wrapping_add(i));
                        let carried = script.carry();
                        let wrong = carried.as_ref().err().map(|_| script.shrink());
                        let mut all = all.lock().expect("no thread panics while it holds this");
                        all.captures += 1;
                        all.faults += script.faults.len() as u64;
                        if let Ok(carried) = carried {
                            all.executions += carried.executions;
                            all.readings += carried.readings;
                        }
                        all.wrong.extend(wrong);
                        drop(all);
                        done(finished.fetch_add(1, Ordering::Relaxed) + 1);
                    }
                });
            }
        });
        let mut all = all.into_inner().expect("all threads have ended");
        all.wrong.sort_by_key(|(script, _)| script.seed);
        all
    }
}

impl Script {
    /// One to five faults.
    pub(crate) fn random(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let devices = [Device::Light, Device::Sensor, Device::Photometer];
        let mut faults: Vec<Trouble> = (0..random.random_range(1..=5))
            .map(|_| Trouble {
                device: devices[random.random_range(0..devices.len())],
                at_s: (random.random_range(0.0..WITHIN_S) * 1e3).round() / 1e3,
                what: disturbance(&mut random),
            })
            .collect();
        faults.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        Self { seed, faults }
    }

    /// The shortest script that still goes wrong: faults are left out one after the other, again and again.
    fn shrink(&self) -> (Self, String) {
        let mut script = self.clone();
        let mut why = script.carry().err().unwrap_or_else(|| "only once".to_owned());
        let mut i = 0;
        while i < script.faults.len() {
            let mut shorter = script.clone();
            shorter.faults.remove(i);
            match shorter.carry() {
                Err(still) => (script, why, i) = (shorter, still, 0),
                Ok(_) => i += 1,
            }
        }
        (script, why)
    }

    /// Carries one capture out under a paused clock.
    fn carry(&self) -> Result<Carried, String> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .start_paused(true)
            .build()
            .map_err(|error| error.to_string())?;
        let carried = catch_unwind(AssertUnwindSafe(|| runtime.block_on(self.carry_out())));
        carried.unwrap_or_else(|panic| {
            let text = panic.downcast_ref::<String>().cloned();
            let text = text.or_else(|| panic.downcast_ref::<&str>().map(|&text| text.to_owned()));
            Err(format!("panic: {}", text.unwrap_or_default()))
        })
    }

    async fn carry_out(&self) -> Result<Carried, String> {
        let text = format!("[sim]\nspecimen = \"{SPECIMEN}\"\nseed = {}\n", self.seed >> 1);
        let say = |error: &dyn std::error::Error| error.to_string();
        let file = RigFile::parse(&text, "campaign".as_ref()).map_err(|error| say(&error))?;
        let mut rig = InProcessRig::new(&file).map_err(|error| say(&error))?;
        let start = rig.snapshot().await.map_err(|error| say(&error))?.pose();
        let job = Job::parse(JOB, "campaign").map_err(|error| say(&error))?;
        let plan = sweep::plan(&job, &capture::mechanics(&file, Some(start))).map_err(|error| say(&error))?;
        let steps = plan.steps.len();
        let bench = rig.bench();
        for trouble in &self.faults {
            bench.schedule(Fault {
                device: trouble.device,
                at: Duration::from_secs_f64(trouble.at_s),
                what: trouble.what,
            });
        }
        let mut journal = Memory(vec![Record::Header(Header {
            run: self.seed.to_string(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            job: JOB.to_owned(),
            rig: text,
            plan,
            started: String::new(),
            certificate: None,
        })]);
        let mut drive = Drive::new(rig, file.clone());
        let (_operator, control) = watch::channel(Command::Run);
        let mut last = String::new();
        for execution in 1..=MAX_EXECUTIONS {
            let mut unseen = |_| ();
            let run = capture::run(&mut drive, &mut journal, control.clone(), &mut unseen);
            let outcome = tokio::time::timeout(HANG, run)
                .await
                .map_err(|_| format!("execution {execution} hangs"))?
                .map_err(|error| say(&error))?;
            tokio::time::sleep(REST).await;
            safe(&bench).map_err(|why| format!("after {outcome:?}: {why}"))?;
            match outcome {
                Outcome::Done => {
                    let readings = whole(&journal.0, steps, &file)?;
                    return Ok(Carried {
                        executions: u64::from(execution),
                        readings,
                    });
                }
                Outcome::Stopped => return Err("stopped by nobody".to_owned()),
                Outcome::Failed { fault } if fault.is_empty() => {
                    return Err("a fault without words".to_owned());
                }
                Outcome::Failed { fault } => {
                    last = fault;
                    for device in [Device::Light, Device::Sensor, Device::Photometer] {
                        bench.reboot(device);
                    }
                    tokio::time::sleep(REST).await;
                }
            }
        }
        Err(format!(
            "not complete after {MAX_EXECUTIONS} executions; last: {last}"
        ))
    }
}

fn disturbance(random: &mut ChaCha8Rng) -> Disturbance {
    let ms = |random: &mut ChaCha8Rng, range: std::ops::Range<u64>| {
        Duration::from_millis(random.random_range(range))
    };
    match random.random_range(0..9) {
        0 => Disturbance::Silence(ms(random, 1..400)),
        1 => Disturbance::Silence(ms(random, 400..8000)),
        2 => Disturbance::OVERLOAD,
        3 => Disturbance::OVERHEATING,
        4 => Disturbance::ALERT,
        5 => Disturbance::Stall(ms(random, 10..6000)),
        6 => Disturbance::RefusedTrigger,
        7 => Disturbance::LostAcknowledgement,
        _ => Disturbance::Reboot,
    }
}

/// Lamp off and both arms standing.
fn safe(bench: &SharedBench) -> Result<(), String> {
    let peek = |device, register| {
        bench
            .peek(device, register)
            .map_err(|refusal| format!("{refusal:?}"))
    };
    if peek(Device::Photometer, photometer::LAMP_ENABLE)? != 0 {
        return Err("the lamp is on".to_owned());
    }
    for device in [Device::Light, Device::Sensor] {
        if peek(device, servo::MOVING)? != 0 {
            return Err(format!("the {device} moves"));
        }
    }
    Ok(())
}

/// Every step once, and each reflectance true within its uncertainty; how many were compared.
fn whole(records: &[Record], steps: usize, file: &RigFile) -> Result<u64, String> {
    let all = report::measurements(records, file);
    let mut accepted = vec![0; steps];
    for m in all.iter().filter(|m| m.reading.accepted) {
        accepted[m.reading.step] += 1;
    }
    if let Some(step) = accepted.iter().position(|&n| n != 1) {
        return Err(format!("step {step} has {} accepted readings", accepted[step]));
    }
    let truth = brdf::specimen(SPECIMEN).map_err(|error| error.to_string())?;
    let mut compared = 0;
    for m in all.iter().filter(|m| m.reading.accepted && m.reading.lamp) {
        let at = format!(
            "step {}, light {:.2}°, sensor {:.2}°",
            m.reading.step,
            m.pose.light.deg(),
            m.pose.sensor.deg()
        );
        let (Some(f), Some(u)) = (m.rgb(), m.u) else {
            return Err(format!("{at}: no reflectance, {:?}", m.reflectance));
        };
        let truth = truth.eval(m.pose.incident(), m.pose.exitant());
        if ((f - truth).abs() - WRONG * u).max_element() > 0.0 {
            return Err(format!("{at}: {f} ± {u} sr⁻¹, the truth is {truth}"));
        }
        compared += 1;
    }
    Ok(compared)
}

/// Records in memory.
pub(crate) struct Memory(pub(crate) Vec<Record>);

#[async_trait::async_trait]
impl Journal for Memory {
    async fn append(&mut self, record: &Record) -> Result<(), JournalError> {
        self.0.push(record.clone());
        Ok(())
    }

    fn records(&self) -> &[Record] {
        &self.0
    }
}
