use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use brdf::MerlTable;
use capture::{Reading, Record};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use crate::{Captured, Service, Simulator};

/// An ideal instrument in simulated time: what is measured does not depend on when.
const RIG: &str = "sim.imperfections = \"none\"\n";
const JOB: &str = "on_stage = true\n[[plane]]\ntheta_r_deg = 60\nreadings = 12\n[arc]\nreadings = 8\n";
/// Longest wait after the event at which a kill is aimed.
const AFTER_EVENT: Duration = Duration::from_millis(5);
/// Share of lives that end by a kill, until there were enough.
const KILLED: f64 = 0.75;

/// By how much a value of the BRDF may differ from that of the undisturbed run, relative to it and in sr⁻¹: a resumed
/// run takes fresh dark readings, and a mean of more of them is rounded otherwise.
const ROUNDING: f64 = 1e-5;

/// What must be the same however often a run was killed.
#[derive(Debug)]
struct Essence {
    brdf: MerlTable,
    readings: Vec<Kept>,
}

impl Essence {
    /// Whether every planned reading is the same to the last bit, and the BRDF but for rounding.
    fn agrees(&self, other: &Self) -> bool {
        let nodes = self.brdf.nodes().iter().flatten();
        let close = |(a, b): (&f64, &f64)| (a - b).abs() <= ROUNDING * (1.0 + b.abs());
        self.readings == other.readings && nodes.zip(other.brdf.nodes().iter().flatten()).all(close)
    }
}

/// What an accepted reading must have in common with that of the undisturbed run.
#[derive(Debug, PartialEq)]
struct Kept {
    step: usize,
    rgb: [u32; 3],
    monitor: u32,
    exposure: rig::Exposure,
    /// Bits of both measured angles.
    measured: [u64; 2],
}

/// How many kills fell into which phase.
pub type Tally = BTreeMap<String, usize>;

/// When a life ends.
enum Moment {
    Time(Duration),
    Event { count: usize, after: Duration },
}

/// A job, a rig in this process and a daemon that is killed over and over.
struct Scene {
    program: String,
    _folder: tempfile::TempDir,
    _simulator: Simulator,
    job: PathBuf,
    rig: PathBuf,
    data: PathBuf,
    /// Readings that some life of the daemon said were durable: step and attempt.
    told: Vec<(u64, u64)>,
}

/// How one life of the daemon went.
struct Life {
    /// What it was doing when it was killed; `None` where the job was done before.
    phase: Option<String>,
    events: usize,
    took: Duration,
}

/// Kills the daemon at random moments until that happened `kills` times, each time followed by a restart and a
/// resume; every run must be completed, hold every reading of its plan once, to the last bit as in an undisturbed run, and
/// give the BRDF of that. Returns what the kills interrupted.
///
/// # Panics
/// If a run does not.
pub fn kills(program: &str, seed: u64, kills: usize) -> Tally {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut scene = Scene::new(program);
    let undisturbed = scene.life(None);
    let whole = scene.essence();
    let mut tally = Tally::new();
    while tally.values().sum::<usize>() < kills {
        let mut scene = Scene::new(program);
        loop {
            let enough = tally.values().sum::<usize>() >= kills;
            let moment = (!enough && random.random_bool(KILLED)).then(|| match random.random_bool(0.5) {
                true => Moment::Time(undisturbed.took.mul_f64(random.random())),
                false => Moment::Event {
                    count: random.random_range(1..=undisturbed.events),
                    after: AFTER_EVENT.mul_f64(random.random()),
                },
            });
            match scene.life(moment).phase {
                Some(phase) => *tally.entry(phase).or_default() += 1,
                None => break,
            }
        }
        assert!(
            scene.essence().agrees(&whole),
            "the result differs (seed {seed}, {tally:?})"
        );
    }
    tally
}

impl Scene {
    fn new(program: &str) -> Self {
        let folder = tempfile::tempdir().expect("there is room for temporary files");
        let simulator = Simulator::new(RIG);
        let job = folder.path().join("job.toml");
        std::fs::write(&job, JOB).expect("the folder is ours");
        Self {
            program: program.to_owned(),
            rig: simulator.rig_file(folder.path()),
            data: folder.path().join("data"),
            job,
            _simulator: simulator,
            _folder: folder,
            told: Vec::new(),
        }
    }

    /// Starts the daemon and has the job done, or kills it at a moment.
    fn life(&mut self, moment: Option<Moment>) -> Life {
        let begun = Instant::now();
        let mut service = Service::start(&self.program, &self.rig, &self.data);
        let mut until = match moment {
            Some(Moment::Time(after)) => Some(begun + after),
            _ => None,
        };
        let mut phase = "opening".to_owned();
        let mut events = 0;
        let mut done = false;
        while !done {
            let Some(said) = service.next(until) else { break };
            events += 1;
            if let Some(Moment::Event { count, after }) = moment
                && events == count
            {
                until = Some(Instant::now() + after);
            }
            self.hear(&said, &mut phase);
            done = self.lead(&said, &mut service);
        }
        let took = begun.elapsed();
        for said in service.kill() {
            self.hear(&said, &mut phase);
        }
        Life {
            phase: (!done).then_some(phase),
            events,
            took,
        }
    }

    /// Says what is to be done next; whether the job is done.
    fn lead(&self, said: &Value, service: &mut Service) -> bool {
        assert!(said.get("refusal").is_none(), "{said}");
        if said.get("open").is_some() {
            service.tell("jobs");
        }
        if let Some(Value::Array(jobs)) = said.get("answer") {
            let job = jobs.first();
            let id = job.and_then(|job| job["id"].as_str()).unwrap_or_default();
            match job.and_then(|job| job["state"].as_str()) {
                None => service.tell(&format!("submit {}", self.job.display())),
                Some("interrupted") => service.tell(&format!("resume {id}")),
                Some("queued" | "awaiting_specimen") => service.tell(&format!("ready {id}")),
                Some("done") => return true,
                Some(other) => panic!("after a restart the job is {other}"),
            }
        }
        assert!(said["event"] != "fault", "{said}");
        said["event"] == "job" && said["job"]["state"] == "done"
    }

    /// Notes what it does, and which readings it says are durable.
    fn hear(&mut self, said: &Value, phase: &mut String) {
        match said["event"].as_str() {
            Some("activity") => *phase = said["activity"].as_str().unwrap_or_default().to_owned(),
            Some("step") => *phase = "moving or integrating".to_owned(),
            Some("reading") => {
                *phase = "between readings".to_owned();
                let number = |key: &str| said["reading"][key].as_u64().expect("a reading has it");
                self.told.push((number("step"), number("attempt")));
            }
            _ => {}
        }
    }

    /// What came of the run, after asserting that nothing was lost or doubled.
    fn essence(&self) -> Essence {
        let run = only_run(&self.data.join("runs"));
        let captured = Captured::read(&run);
        let readings: Vec<&Reading> = captured.readings().collect();
        let mut keys: Vec<(u64, u64)> = readings
            .iter()
            .map(|reading| (reading.step as u64, u64::from(reading.attempt)))
            .collect();
        for told in &self.told {
            assert!(keys.contains(told), "reading {told:?} was lost");
        }
        let taken = keys.len();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), taken, "a reading is there twice");
        let Some(Record::Header(header)) = captured.records.first() else {
            panic!("the journal has a header");
        };
        let planned = header.plan.steps.len();
        // What was taken again because of the kills is beyond the plan.
        let of_plan = |reading: &&&Reading| reading.accepted && reading.step < planned;
        let accepted: Vec<&&Reading> = readings.iter().filter(of_plan).collect();
        let steps: Vec<usize> = accepted.iter().map(|reading| reading.step).collect();
        assert_eq!(steps, (0..planned).collect::<Vec<_>>());
        let reading = |reading: &&&Reading| {
            let measured = [reading.measured.light, reading.measured.sensor];
            Kept {
                step: reading.step,
                rgb: reading.counts.rgb,
                monitor: reading.counts.monitor,
                exposure: reading.counts.exposure,
                measured: measured.map(|angle| angle.rad().to_bits()),
            }
        };
        Essence {
            brdf: MerlTable::read(&run.join("brdf.binary")).expect("a run that is done has a BRDF"),
            readings: accepted.iter().map(reading).collect(),
        }
    }
}

fn only_run(runs: &Path) -> PathBuf {
    let found: Vec<_> = std::fs::read_dir(runs)
        .expect("a run was made")
        .map(|entry| entry.expect("the folder is ours").path())
        .filter(|path| path.join("brdf.binary").exists())
        .collect();
    assert_eq!(found.len(), 1, "{found:?}");
    found[0].clone()
}
