//! A simulated rig, a job and a journal to run it with.

use capture::{
    CaptureError, Command, Event, Header, Journal, JournalError, Outcome, Reading, Record, extended_plan,
    mechanics,
};
use firmware_sim::in_process::{InProcessRig, SharedBench};
use rig::dynamixel::register::{common, photometer, servo};
use rig::{Device, Drive, Rig, RigFile};
use sweep::{Job, Mechanics, Plan, plan};
use tokio::sync::watch;

pub(crate) const SHORT: &str = "[[plane]]\ntheta_r_deg = 60\nreadings = 12\n[arc]\nreadings = 8";
pub(crate) const PAPER: &str = include_str!("../../../../config/jobs/paper.toml");
pub(crate) const SERVOS: [Device; 2] = [Device::Light, Device::Sensor];

type AtAppend = Box<dyn FnMut(&Record) -> Result<(), JournalError> + Send>;

/// Records in memory, with something to do at each append.
pub(crate) struct MemoryJournal {
    pub(crate) records: Vec<Record>,
    /// Called before a record is kept; may refuse it.
    pub(crate) at_append: AtAppend,
    /// Bytes that the medium has room for.
    pub(crate) room: Option<u64>,
}

impl MemoryJournal {
    pub(crate) fn new(plan: Plan) -> Self {
        let header = Header {
            run: "test".to_owned(),
            version: "0".to_owned(),
            job: String::new(),
            rig: String::new(),
            plan,
            started: String::new(),
            certificate: None,
        };
        Self {
            records: vec![Record::Header(header)],
            at_append: Box::new(|_| Ok(())),
            room: None,
        }
    }

    pub(crate) fn readings(&self) -> Vec<&Reading> {
        let readings = self.records.iter().filter_map(|record| match record {
            Record::Reading(reading) => Some(reading),
            _ => None,
        });
        readings.collect()
    }

    pub(crate) fn accepted(&self) -> Vec<&Reading> {
        self.readings()
            .into_iter()
            .filter(|reading| reading.accepted)
            .collect()
    }

    /// Steps of the plan and of all that was added to it.
    pub(crate) fn step_count(&self) -> usize {
        let added = self.records.iter().map(|record| match record {
            Record::Extension(extension) => extension.steps.len(),
            _ => 0,
        });
        self.plan().steps.len() + added.sum::<usize>()
    }

    pub(crate) fn plan(&self) -> &Plan {
        match &self.records[0] {
            Record::Header(header) => &header.plan,
            other => panic!("begins with {other:?}"),
        }
    }
}

#[async_trait::async_trait]
impl Journal for MemoryJournal {
    async fn append(&mut self, record: &Record) -> Result<(), JournalError> {
        (self.at_append)(record)?;
        self.records.push(record.clone());
        Ok(())
    }

    fn records(&self) -> &[Record] {
        &self.records
    }

    fn room(&self) -> Option<u64> {
        self.room
    }
}

/// A rig, its bench, and a journal with a job's plan.
pub(crate) struct Scene {
    pub(crate) drive: Drive<InProcessRig>,
    pub(crate) bench: SharedBench,
    pub(crate) journal: MemoryJournal,
    pub(crate) control: watch::Sender<Command>,
}

impl Scene {
    /// A job on the rig of config/rig.toml with these lines in its `[sim]` table.
    pub(crate) async fn new(job: &str, sim: &str) -> Self {
        let file = RigFile::parse(&format!("[sim]\n{sim}"), "test.toml".as_ref()).expect("a good rig file");
        Self::on(file, job).await
    }

    pub(crate) async fn on(file: RigFile, job: &str) -> Self {
        let mut rig = InProcessRig::new(&file).expect("a good [sim] table");
        let start = rig.snapshot().await.expect("all devices answer").pose();
        let job = Job::parse(job, "job.toml").expect("a good job");
        // This rig has no wire.
        let mechanics = Mechanics {
            transaction_s: 0.0,
            in_flight: true,
            flight_s: 0.006,
            ..mechanics(&file, Some(start))
        };
        let plan = plan(&job, &mechanics).expect("possible on this rig");
        Self {
            bench: rig.bench(),
            drive: Drive::new(rig, file),
            journal: MemoryJournal::new(plan),
            control: watch::Sender::new(Command::Run),
        }
    }

    /// Runs what is left of the plan.
    pub(crate) async fn run(
        &mut self,
        mut on_event: impl FnMut(Event) + Send,
    ) -> Result<Outcome, CaptureError> {
        let control = self.control.subscribe();
        capture::run(&mut self.drive, &mut self.journal, control, &mut on_event).await
    }

    pub(crate) fn lamp_is_on(&self) -> bool {
        peek(&self.bench, Device::Photometer, photometer::LAMP_ENABLE) == 1
    }

    /// Lamp off, arms standing at their goals, no watchdog left that would trip once the host is silent.
    pub(crate) fn assert_safe(&self) {
        assert!(!self.lamp_is_on(), "the lamp is on");
        for device in SERVOS {
            // Friction takes three counts, and a tremble and the rounding one each.
            let off = peek(&self.bench, device, servo::PRESENT_POSITION)
                - peek(&self.bench, device, servo::GOAL_POSITION);
            assert!(off.abs() <= 5, "{device} is {off} counts off its goal");
            assert_eq!(
                peek(&self.bench, device, common::BUS_WATCHDOG),
                0,
                "watchdog of {device}"
            );
        }
        assert_eq!(
            peek(&self.bench, Device::Photometer, common::BUS_WATCHDOG),
            0,
            "watchdog of the photometer"
        );
    }
}

pub(crate) fn peek(bench: &SharedBench, device: Device, register: rig::dynamixel::register::Register) -> i64 {
    bench.peek(device, register).expect("the table has it")
}

/// Every step once: those of the plan in order, and between them what a hold has added.
pub(crate) fn assert_complete(journal: &MemoryJournal) {
    let planned = journal.plan().steps.len();
    let plan = extended_plan(&journal.records).expect("there is a header");
    let mut steps: Vec<usize> = journal.accepted().iter().map(|reading| reading.step).collect();
    let in_order: Vec<usize> = steps.iter().copied().filter(|&step| step < planned).collect();
    assert_eq!(in_order, (0..planned).collect::<Vec<_>>());
    steps.sort_unstable();
    assert_eq!(steps, (0..plan.steps.len()).collect::<Vec<_>>());
}
