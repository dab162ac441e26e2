use arms::Pose;

use crate::Counts;

/// A raw reading with where and when it was taken: what calibrations are made of and applied to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taken {
    /// Where the arms were, as their encoders said.
    pub pose: Pose,
    /// Rig time, s.
    pub time_s: f64,
    /// Whether the lamp was on.
    pub lamp: bool,
    /// What the photometer said.
    pub counts: Counts,
}
