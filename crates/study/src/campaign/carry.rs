use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use capture::{Command, Header, MemoryJournal, Outcome, Record};
use firmware_sim::{Disturbance, Fault};
use report::Verdict;
use rig::dynamixel::register::{Register, photometer, servo};
use rig::{Device, Drive, Rig, RigFile};
use sweep::Job;
use tokio::sync::watch;

use super::in_process::InProcess;
use super::truth::whole;
use super::wire::OverWire;
use super::{Carried, Script};

/// A job of all kinds of steps, in seconds of rig time.
const JOB: &str = "[[plane]]\ntheta_r_deg = 60\nreadings = 8\n[arc]\nreadings = 5\n";
/// A diffuse specimen with a lobe.
const SPECIMEN: &str = "blue-rubber";
/// Executions after which a run must be complete: each fault ends one at most, and a third of them is to spare.
const MAX_EXECUTIONS: u64 = 8;
/// The devices.
pub(super) const DEVICES: [Device; 3] = [Device::Light, Device::Sensor, Device::Photometer];

/// A simulated rig that captures are carried out on, with a view behind it.
pub(super) trait Bench: Send + Sized {
    /// What drives it.
    type Rig: Rig;

    /// Time in which one execution must end, come what may.
    const HANG: Duration;

    /// The rig of a script, its faults lying in wait.
    fn new(script: &Script, file: &RigFile) -> Result<(Self, Self::Rig), String>;

    /// Looks whether something is to be done to it now; called at everything that happens in a capture.
    fn look(&mut self) {}

    /// Lets time pass in which watchdogs trip and boots end, while nobody speaks to the rig.
    async fn rest(&self);

    /// A register, past the bus.
    fn peek(&self, device: Device, register: Register) -> Result<i64, String>;

    /// Mends what is broken for good, as a technician would, and gives the rig back.
    fn mend(&mut self, rig: Drive<Self::Rig>, file: &RigFile) -> Result<Drive<Self::Rig>, String>;
}

/// Carries a script's capture out.
pub(super) fn carry(script: &Script) -> Result<Carried, String> {
    // Over a quiet terminal a paused clock would jump to the next deadline.
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_time()
        .start_paused(!script.over_wire)
        .build()
        .map_err(words)?;
    let carried = catch_unwind(AssertUnwindSafe(|| match script.over_wire {
        true => runtime.block_on(carry_out::<OverWire>(script)),
        false => runtime.block_on(carry_out::<InProcess>(script)),
    }));
    carried.unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|&text| text.to_owned()));
        Err(format!("panic: {}", text.unwrap_or_default()))
    })
}

async fn carry_out<B: Bench>(script: &Script) -> Result<Carried, String> {
    let text = rig_file(script);
    let file = RigFile::parse(&text, "campaign".as_ref()).map_err(words)?;
    let specimen = brdf::specimen(SPECIMEN).map_err(words)?;
    let (mut bench, rig) = B::new(script, &file)?;
    let mut drive = Drive::new(rig, file.clone());
    let job = Job::parse(JOB, "campaign").map_err(words)?;
    // Where the simulator's arms stand when power comes on; to look would be to meet the faults before the capture.
    let plan = sweep::plan(&job, &capture::mechanics(&file, Some(file.motion.park))).map_err(words)?;
    let steps = plan.steps.len();
    let mut journal = MemoryJournal(vec![Record::Header(Header {
        run: script.seed.to_string(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        job: JOB.to_owned(),
        rig: text,
        plan,
        started: String::new(),
        certificate: None,
    })]);
    let (_operator, control) = watch::channel(Command::Run);
    let mut faults = Vec::new();
    for execution in 1..=MAX_EXECUTIONS {
        let mut look = |_| bench.look();
        let run = capture::run(&mut drive, &mut journal, control.clone(), &mut look);
        let outcome = tokio::time::timeout(B::HANG, run)
            .await
            .map_err(|_| format!("execution {execution} hangs"))?
            .map_err(words)?;
        bench.rest().await;
        safe(&bench).map_err(|why| format!("after {outcome:?}: {why}"))?;
        match outcome {
            Outcome::Done => {
                let lit = lit_from_outside(script);
                let (verdict, checks) = match lit || script.seed.is_multiple_of(JUDGED) {
                    true => report::judge(&journal.0).map_err(words)?,
                    false => (Verdict::Good, Vec::new()),
                };
                let bad = verdict == Verdict::Bad;
                if bad && !lit {
                    let why = checks.into_iter().filter(|check| check.verdict == Verdict::Bad);
                    let why: Vec<String> = why.map(|check| check.text).collect();
                    return Err(format!(
                        "called bad without light from outside: {}",
                        why.join(" ")
                    ));
                }
                let readings = match bad {
                    true => 0,
                    false => whole(&journal.0, steps, &job, &file, &*specimen)?,
                };
                return Ok(Carried {
                    executions: execution,
                    bad,
                    readings,
                });
            }
            Outcome::Stopped => return Err("stopped by nobody".to_owned()),
            Outcome::Failed { fault } if fault.is_empty() => return Err("a fault without words".to_owned()),
            Outcome::Failed { fault } => faults.push(fault),
        }
        drive = bench.mend(drive, &file)?;
        bench.rest().await;
    }
    Err(format!(
        "not complete after {MAX_EXECUTIONS} executions: {}",
        faults.join("; ")
    ))
}

/// Of the captures without light from outside one in so many is judged: to make a model and look at all of it takes longer
/// than to carry a capture out.
const JUDGED: u64 = 16;

/// Whether a script lets light in that is not the lamp's: the one fault after which a whole run may be of no use.
fn lit_from_outside(script: &Script) -> bool {
    let light = |fault: &Fault| matches!(fault.what, Disturbance::Glare(_) | Disturbance::RoomLight(_));
    script.fault.iter().any(light)
}

/// The rig of a script. Its seed is half the script's, since TOML's numbers have 63 bits.
fn rig_file(script: &Script) -> String {
    format!("[sim]\nspecimen = \"{SPECIMEN}\"\nseed = {}\n", script.seed >> 1)
}

/// Lamp off and both arms standing.
fn safe(bench: &impl Bench) -> Result<(), String> {
    if bench.peek(Device::Photometer, photometer::LAMP_ENABLE)? != 0 {
        return Err("the lamp is on".to_owned());
    }
    for device in [Device::Light, Device::Sensor] {
        if bench.peek(device, servo::MOVING)? != 0 {
            return Err(format!("the {device} moves"));
        }
    }
    Ok(())
}

/// An error in words, with its causes.
pub(super) fn words(error: impl std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |error| error.source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}
