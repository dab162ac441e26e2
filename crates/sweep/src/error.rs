use arms::{Pose, Violation};

/// Why a job file is refused, or cannot become a plan on this rig.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// The job file is not what a job file may be.
    #[error("{file}{}: {key}: {why}", .line.map(|line| format!(", line {line}")).unwrap_or_default())]
    File {
        /// The job file.
        file: String,
        /// Line, from 1, where one can be named.
        line: Option<usize>,
        /// The key at fault, or the text of the line.
        key: String,
        /// What was found and what is allowed.
        why: String,
    },
    /// The job is sound but this rig cannot do it.
    #[error("{file}: {key}: {why}")]
    Unreachable {
        /// The job file.
        file: String,
        /// The key at fault.
        key: String,
        /// What was asked and what the rig allows.
        why: String,
    },
    /// The arms stand where no motion may begin.
    #[error(
        "the arms stand at light {:.2}°, sensor {:.2}°, outside what the rig file allows; bring them back by hand",
        .pose.light.deg(),
        .pose.sensor.deg()
    )]
    Start {
        /// Where they stand.
        pose: Pose,
        /// What that breaks.
        source: Violation,
    },
    /// No motion inside the envelope leads from one pose to the other.
    #[error(
        "no safe way leads from light {:.2}°, sensor {:.2}° to light {:.2}°, sensor {:.2}°",
        .from.light.deg(), .from.sensor.deg(), .to.light.deg(), .to.sensor.deg()
    )]
    NoWay {
        /// Where the arms stand.
        from: Pose,
        /// Where they should go.
        to: Pose,
    },
    /// A motion of the finished plan would break the envelope. The planner avoids that; this is its last look.
    #[error("step {step} of the plan would break the envelope")]
    Leg {
        /// The step.
        step: usize,
        /// What it would break.
        source: Violation,
    },
}
