use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::{JobId, JobState, RecordView, VerdictView};

/// A run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RunView {
    /// Its id, never reused.
    pub id: String,
    /// Its place among all runs, in the order in which they began; the history begins with the largest.
    #[serde(default)]
    pub place: u64,
    /// The job that it executes.
    pub job: JobId,
    /// How that job stands.
    pub state: JobState,
    /// What messages call the job's file.
    pub name: String,
    /// What was measured, in the technician's words.
    pub specimen: String,
    /// What else is said of it.
    #[serde(default)]
    pub record: RecordView,
    /// When it was put away, RFC 3339, UTC; `None` while it is in the history.
    #[serde(default)]
    pub archived: Option<String>,
    /// Where its files are.
    #[cfg_attr(feature = "openapi", schema(value_type = String))]
    pub directory: PathBuf,
    /// When it began, RFC 3339, UTC.
    pub started: String,
    /// When its files were written last, RFC 3339, UTC; `None` before.
    pub reported: Option<String>,
    /// What the checks said of its result when its files were written last; `None` before.
    pub verdict: Option<VerdictView>,
    /// Steps of its plan.
    pub planned: u64,
    /// Steps with an accepted reading.
    pub accepted: u64,
}
