use async_trait::async_trait;
use rig::{Certificate, Identity};
use serde::{Deserialize, Serialize};
use sweep::{Plan, Step};

use crate::{JournalError, Reading};

/// First record of a journal: all that is needed to go on with the run elsewhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Id of the run, never reused.
    pub run: String,
    /// Version of the program.
    pub version: String,
    /// The job file as given.
    pub job: String,
    /// The rig file as given.
    pub rig: String,
    /// What is measured. Kept, not planned again: planning depends on where the arms stood and on the program's
    /// version, and readings refer to its steps by index.
    pub plan: Plan,
    /// Wall clock at the start, RFC 3339, UTC.
    pub started: String,
    /// The stored calibration that holds for the run, where one is used: kept whole, so that the run can be worked out
    /// again without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certificate: Option<Box<Certificate>>,
}

/// How an execution of a plan ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "outcome")]
pub enum Outcome {
    /// Every step was read.
    Done,
    /// The operator stopped it; it can be resumed.
    Stopped,
    /// A fault ended it; it can be resumed once that is mended.
    Failed {
        /// The fault in words, with its causes.
        fault: String,
    },
}

/// Steps that were added to a plan while it ran, and why; without steps it is the last word: nothing more is measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extension {
    /// Their indices go on from those before.
    pub steps: Vec<Step>,
    /// Why, in words.
    pub why: String,
    /// MALE that was expected of a reconstruction from the readings so far.
    pub expected_male: Option<f64>,
}

/// The plan of a journal with all its extensions; `None` without a header.
pub fn extended_plan(records: &[Record]) -> Option<Plan> {
    let Some(Record::Header(header)) = records.first() else {
        return None;
    };
    let mut plan = header.plan.clone();
    for record in records {
        if let Record::Extension(extension) = record {
            plan.steps.extend_from_slice(&extension.steps);
        }
    }
    Some(plan)
}

/// Whether a journal holds the last word on what is measured: its plan is not open, or an extension without steps
/// closed it.
pub fn closed(records: &[Record]) -> bool {
    records.iter().rev().any(|record| match record {
        Record::Header(header) => !header.plan.open,
        Record::Extension(extension) => extension.steps.is_empty(),
        _ => false,
    })
}

/// One line of the journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "record")]
pub enum Record {
    /// The first one.
    Header(Header),
    /// An execution begins or goes on: who answered on the bus (light, sensor, photometer), and the device time.
    Begin {
        /// Light servo, sensor servo, photometer.
        identities: Vec<Identity>,
        /// Unwrapped device time, ticks of 10 µs.
        device_ticks: u64,
        /// Wall clock, RFC 3339, UTC.
        at: String,
    },
    /// A reading was taken.
    Reading(Reading),
    /// Steps were added to the plan.
    Extension(Extension),
    /// A resumed run measured a pose of its finished part again, to show whether lamp, stage or specimen changed
    /// meanwhile. Nothing is made of it.
    Repeat {
        /// The new reading, with the step that it repeats.
        reading: Reading,
        /// By how much the brightest channel differs from before, relative to the lamp monitor; dark counts included.
        difference_rel: f64,
    },
    /// The run holds by itself.
    Suspended {
        /// Why, in words.
        why: String,
        /// Unwrapped device time, ticks of 10 µs.
        device_ticks: u64,
        /// Wall clock, RFC 3339, UTC.
        at: String,
    },
    /// It goes on.
    Released {
        /// Unwrapped device time, ticks of 10 µs.
        device_ticks: u64,
        /// Wall clock, RFC 3339, UTC.
        at: String,
    },
    /// An execution ended.
    End {
        /// How.
        outcome: Outcome,
        /// Unwrapped device time, ticks of 10 µs, where the photometer still answered.
        device_ticks: Option<u64>,
        /// Wall clock, RFC 3339, UTC.
        at: String,
    },
}

/// Where records are kept: append-only, in order.
#[async_trait]
pub trait Journal: Send {
    /// Appends a record and returns once it is durable.
    ///
    /// An append that is dropped half-way may or may not have happened; the next one settles that first, so that
    /// [`Self::records`] is always what is kept.
    ///
    /// # Errors
    /// The medium refused (disk full); what was appended before is still there.
    async fn append(&mut self, record: &Record) -> Result<(), JournalError>;

    /// All records, oldest first.
    fn records(&self) -> &[Record];

    /// Bytes that there is room for where they are kept; `None` where nobody knows.
    fn room(&self) -> Option<u64> {
        None
    }
}
