use arms::Pose;
use rig::Counts;
use serde::{Deserialize, Serialize};
use sweep::Sweep;

/// Something to know about a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Flag {
    /// A channel is at full scale even in the shortest, weakest exposure.
    Saturated,
    /// Too few counts even in the longest, strongest exposure.
    Dim,
    /// An arm moved too far within its integration, or not as it was told to.
    Blurred,
    /// The bus had to be asked more than once.
    Retried,
    /// One arm may have shadowed the other within the integration.
    Shadowed,
}

/// One reading of the photometer with its pose, raw: nothing is subtracted or divided.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// Index of its step in the plan.
    pub step: usize,
    /// Exposures of this step before this one.
    pub attempt: u32,
    /// Whether this is the one that counts for its step. Those before it were saturated or too dim; one after it is there
    /// for a channel that was too faint in it.
    pub accepted: bool,
    /// What it belongs to.
    pub sweep: Sweep,
    /// Whether the lamp was on.
    pub lamp: bool,
    /// Where the arms were told to be.
    pub goal: Pose,
    /// Where they were: the mean of what was measured before, during and after the integration, or in flight worked out
    /// for mid-integration from what was measured around it.
    pub measured: Pose,
    /// What the photometer said.
    pub counts: Counts,
    /// Device time at mid-integration since the photometer was switched on, unwrapped, in ticks of 10 µs.
    pub device_ticks: u64,
    /// Requests on the bus that had to be repeated for this reading.
    pub retries: u32,
    /// What to know about it.
    pub flags: Vec<Flag>,
    /// In flight, by how much each arm moved within the integration, rad, signed; `None`: they stood still.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub swept_rad: Option<[f64; 2]>,
    /// At rest, between the smallest and the largest angle of each arm that was measured before, during and after the
    /// integration, rad: an arm that is held trembles. In flight, twice the standard deviation of what was measured from
    /// where the arm is worked out to have been. `None` in journals that do not say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread_rad: Option<[f64; 2]>,
}
