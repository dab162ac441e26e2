use serde::{Deserialize, Serialize};

use crate::{Activity, FaultId, FaultView, Job, Progress, ReadingView};

/// Something that happened, with an id that only ever grows, also across restarts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Event {
    /// Its id.
    pub id: u64,
    /// When, RFC 3339, UTC.
    pub at: String,
    /// What.
    #[serde(flatten)]
    pub what: What,
}

/// What happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case", tag = "event")]
pub enum What {
    /// A job is new, or stands otherwise than before.
    Job {
        /// The job now.
        job: Box<Job>,
    },
    /// The rig does something else.
    Activity {
        /// What.
        activity: Activity,
    },
    /// A step of the run begins.
    Step {
        /// Its index in the plan.
        step: usize,
        /// Steps of the plan.
        of: usize,
        /// What it belongs to.
        sweep: String,
        /// Where the light arm goes, degrees.
        light_deg: f64,
        /// Where the sensor arm goes, degrees.
        sensor_deg: f64,
    },
    /// A reading was taken and is durable.
    Reading {
        /// The run.
        run: String,
        /// The reading.
        reading: Box<ReadingView>,
    },
    /// How far the run is.
    Progress {
        /// How far.
        progress: Progress,
    },
    /// A resumed run measured a pose of its finished part again.
    Repeat {
        /// The step that was measured again.
        step: usize,
        /// By how much the brightest channel differs from before, relative to the lamp monitor.
        difference_rel: f64,
    },
    /// Something to know that stops nothing.
    Warning {
        /// In words.
        text: String,
    },
    /// A fault was latched.
    Fault {
        /// Which.
        fault: FaultView,
    },
    /// A fault was acknowledged.
    Acknowledged {
        /// By whom.
        by: String,
        /// The fault's id.
        id: FaultId,
    },
    /// Events before this one are no longer known: look at everything anew.
    Gap,
}
