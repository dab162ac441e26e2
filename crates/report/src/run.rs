use std::collections::BTreeMap;

use capture::{Flag, Header, Outcome, Reading, Record};
use rig::Identity;
use serde::Serialize;
use sha2::{Digest, Sha256};

/// Seconds per tick of the photometer's clock.
pub(crate) const TICK_S: f64 = 1e-5;

/// How a run stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Every step was read.
    Done,
    /// The operator stopped it; it can be resumed.
    Stopped,
    /// A fault ended it; it can be resumed once that is mended.
    Failed,
    /// It goes on, or its process ended without a word; it can be resumed.
    Interrupted,
}

impl State {
    /// Exit status of the command that ran it; `None` while there is none.
    pub fn exit_status(self) -> Option<u8> {
        match self {
            Self::Done => Some(0),
            Self::Failed => Some(3),
            Self::Stopped => Some(4),
            Self::Interrupted => None,
        }
    }
}

/// A text of the journal's header with its SHA-256.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Given {
    /// SHA-256 of the text, hexadecimal.
    pub sha256: String,
    /// The file as given.
    pub text: String,
}

impl Given {
    fn new(text: &str) -> Self {
        let hash = Sha256::digest(text.as_bytes());
        Self {
            sha256: hash.iter().map(|byte| format!("{byte:02x}")).collect(),
            text: text.to_owned(),
        }
    }
}

/// run.json: what was done, with what, and how it went; all of it from the journal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Run {
    /// Id, never reused.
    pub id: String,
    /// How it stands.
    pub state: State,
    /// Exit status of the command that ran it last.
    pub exit_status: Option<u8>,
    /// The fault in words, where one ended it.
    pub fault: Option<String>,
    /// Version of the program that captured it.
    pub version: String,
    /// The job file.
    pub job: Given,
    /// The rig file.
    pub rig: Given,
    /// Light servo, sensor servo, photometer, as they answered last.
    pub identities: Vec<Identity>,
    /// Wall clock at the start, RFC 3339.
    pub started: String,
    /// Wall clock at the end of the last execution, RFC 3339.
    pub ended: Option<String>,
    /// Executions: 1, and one for each resumption.
    pub executions: usize,
    /// Seconds of rig time, by the photometer's clock.
    pub seconds: Seconds,
    /// Readings by kind.
    pub readings: Readings,
    /// Requests on the bus that had to be repeated.
    pub retries: u64,
    /// How many readings carry each flag.
    pub flags: BTreeMap<&'static str, usize>,
}

/// Seconds of rig time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Seconds {
    /// All executions together.
    pub total: f64,
    /// Per sweep: from the reading before, or the start, to each of its readings; "end": from the last one on.
    pub phases: BTreeMap<String, f64>,
}

impl Seconds {
    fn add(&mut self, phase: String, from_ticks: u64, to_ticks: u64) {
        // A photometer that was switched off in between starts its clock again.
        let seconds = to_ticks.saturating_sub(from_ticks) as f64 * TICK_S;
        self.total += seconds;
        *self.phases.entry(phase).or_default() += seconds;
    }
}

/// Counts of readings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Readings {
    /// Steps of the plan.
    pub planned: usize,
    /// Everything that the photometer read.
    pub taken: usize,
    /// Those that count for their step.
    pub accepted: usize,
    /// Those that count although a channel is saturated or has too few counts.
    pub poor: usize,
}

impl Run {
    /// The summary of a journal: its header and all its records.
    pub fn new(header: &Header, records: &[Record]) -> Self {
        let mut run = Self::begun(header);
        let mut clock = 0;
        for record in records {
            match record {
                Record::Header(_) => {}
                Record::Begin {
                    identities,
                    device_ticks,
                    ..
                } => {
                    run.executions += 1;
                    run.state = State::Interrupted;
                    run.identities.clone_from(identities);
                    clock = *device_ticks;
                }
                Record::Reading(reading) => {
                    run.count(reading);
                    run.seconds
                        .add(reading.sweep.to_string(), clock, reading.device_ticks);
                    clock = reading.device_ticks;
                }
                Record::End {
                    outcome,
                    device_ticks,
                    at,
                } => {
                    run.end(outcome, at);
                    run.seconds
                        .add("end".into(), clock, device_ticks.unwrap_or(clock));
                }
            }
        }
        run.exit_status = run.state.exit_status();
        run
    }

    /// Whether every step of the plan has an accepted reading.
    pub fn complete(&self) -> bool {
        self.readings.accepted >= self.readings.planned
    }

    fn begun(header: &Header) -> Self {
        Self {
            id: header.run.clone(),
            state: State::Interrupted,
            exit_status: None,
            fault: None,
            version: header.version.clone(),
            job: Given::new(&header.job),
            rig: Given::new(&header.rig),
            identities: Vec::new(),
            started: header.started.clone(),
            ended: None,
            executions: 0,
            seconds: Seconds::default(),
            readings: Readings {
                planned: header.plan.steps.len(),
                ..Readings::default()
            },
            retries: 0,
            flags: BTreeMap::new(),
        }
    }

    fn count(&mut self, reading: &Reading) {
        self.readings.taken += 1;
        self.readings.accepted += usize::from(reading.accepted);
        let poor = |flag: &Flag| matches!(flag, Flag::Saturated | Flag::Dim);
        self.readings.poor += usize::from(reading.accepted && reading.flags.iter().any(poor));
        self.retries += u64::from(reading.retries);
        for &flag in &reading.flags {
            *self.flags.entry(flag_name(flag)).or_default() += 1;
        }
    }

    fn end(&mut self, outcome: &Outcome, at: &str) {
        (self.state, self.fault) = match outcome {
            Outcome::Done => (State::Done, None),
            Outcome::Stopped => (State::Stopped, None),
            Outcome::Failed { fault } => (State::Failed, Some(fault.clone())),
        };
        self.ended = Some(at.to_owned());
    }
}

/// A flag as files name it.
pub(crate) fn flag_name(flag: Flag) -> &'static str {
    match flag {
        Flag::Saturated => "saturated",
        Flag::Dim => "dim",
        Flag::Retried => "retried",
    }
}
