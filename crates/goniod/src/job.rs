use std::str::FromStr;

use serde::{Deserialize, Serialize};
use ulid::Ulid;
use utoipa::ToSchema;

use crate::JobState;

/// Id of a job: a ULID, never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(into = "String", try_from = "String")]
#[schema(value_type = String, example = "01KAGN4Z7Q3X9V5T8R2M6C1D0B")]
pub struct JobId(Ulid);

impl JobId {
    pub(crate) fn generate() -> Self {
        Self(Ulid::generate())
    }
}

impl std::fmt::Display for JobId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for JobId {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        Ulid::from_string(text)
            .map(Self)
            .map_err(|error| format!("{text:?} is no job id: {error}"))
    }
}

impl TryFrom<String> for JobId {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<JobId> for String {
    fn from(id: JobId) -> Self {
        id.to_string()
    }
}

/// A job in the queue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Job {
    /// Its id.
    pub id: JobId,
    /// Its place among all jobs ever submitted; the queue is worked off in this order.
    pub place: u64,
    /// What messages call its file.
    pub name: String,
    /// What is to lie on the stage, in the technician's words.
    pub specimen: String,
    /// Whether its file says that the specimen is on the stage already.
    pub on_stage: bool,
    /// The job file, TOML.
    pub text: String,
    /// How it stands.
    pub state: JobState,
    /// Why it stands so, where there is something to say: what interrupted or refused it.
    pub why: Option<String>,
    /// Its run, once it has begun.
    pub run: Option<String>,
    /// Who submitted it.
    pub by: String,
    /// When it was submitted, RFC 3339, UTC.
    pub submitted: String,
    /// When its state changed last, RFC 3339, UTC.
    pub changed: String,
}

/// A job to be queued.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Submission {
    /// Text of the job file, TOML.
    pub job: String,
    /// What messages call it.
    pub name: String,
}

/// What an operator does with one job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// Its specimen is on the stage: start.
    Ready,
    /// Give it up.
    Cancel,
    /// Go on where it was interrupted.
    Resume,
}

/// Who asks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Caller {
    /// Name for the audit: a token's name, a user, an address.
    pub name: String,
}
