use std::str::FromStr;

use serde::{Deserialize, Serialize};
use ulid::Ulid;

use crate::{JobState, VerdictView};

/// Id of a job: a ULID, never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(into = "String", try_from = "String")]
#[cfg_attr(feature = "openapi", schema(value_type = String, example = "01KAGN4Z7Q3X9V5T8R2M6C1D0B"))]
pub struct JobId(Ulid);

impl JobId {
    /// A new one, unlike any other.
    pub fn generate() -> Self {
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
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
    /// What the checks say of that run's result, once it was reported. A job that is done may still be bad: everything
    /// was measured, but the result must not be used.
    #[serde(default)]
    pub verdict: Option<VerdictView>,
    /// Whether its run directory gets all files, also the large ones that can be made when somebody asks for them.
    #[serde(default)]
    pub whole: bool,
    /// Who submitted it.
    pub by: String,
    /// When it was submitted, RFC 3339, UTC.
    pub submitted: String,
    /// When its state changed last, RFC 3339, UTC.
    pub changed: String,
}

/// What an operator does with one job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// Its specimen is on the stage: start.
    Ready,
    /// Give it up.
    Cancel,
    /// Go on where it was interrupted.
    Resume,
}

impl std::fmt::Display for Action {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Ready => "ready",
            Self::Cancel => "cancel",
            Self::Resume => "resume",
        })
    }
}
