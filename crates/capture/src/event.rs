use arms::Pose;
use rig::{Device, FaultKind};
use serde::Serialize;
use sweep::Sweep;

use crate::Reading;

/// What an operator asks of a running capture; sent over a `tokio::sync::watch` channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Go on.
    #[default]
    Run,
    /// Finish the reading and hold, lamp on, until told otherwise.
    Pause,
    /// Finish the reading, hold the arms, lamp off, end; the run can be resumed.
    Finish,
    /// Decelerate now on the profiles and hold, lamp off, end; the run can be resumed.
    Stop,
    /// Stop the arms at once as the rig file says, lamp off, end.
    Estop,
}

/// What a capture is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Asking every device who it is; nothing moves.
    Identifying,
    /// Torque on, goals at the present position.
    Engaging,
    /// The lamp is on and not yet steady.
    WarmingUp,
    /// Moving and reading.
    Running,
    /// Holding, on the operator's wish.
    Paused,
    /// Holding, until something is as the rig file wants it.
    Suspended,
    /// Lamp off, arms stopped and disengaged.
    ShuttingDown,
    /// The run is done and recorded, and the arms go to where they are parked.
    Parking,
}

/// What happens in a capture, for whoever watches it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "event")]
pub enum Event {
    /// It does something else now.
    State {
        /// What.
        state: State,
    },
    /// It holds by itself; [`State::Running`] says that it goes on.
    Suspended {
        /// Why, in words.
        why: String,
    },
    /// A step begins.
    Step {
        /// Its index in the plan.
        step: usize,
        /// Steps of the plan.
        of: usize,
        /// What it belongs to.
        sweep: Sweep,
        /// Where its reading is to be taken.
        goal: Pose,
    },
    /// A reading was taken and is durable, accepted or not.
    Reading {
        /// The reading.
        reading: Box<Reading>,
    },
    /// A resumed run measured a pose of its finished part again.
    Repeat {
        /// The new reading, with the step that it repeats.
        reading: Box<Reading>,
        /// By how much the brightest channel differs from before, relative to the lamp monitor.
        difference_rel: f64,
    },
    /// The arms were told to stop, or stand where they are, and the lamp is off: no goal is written any more.
    Safe,
    /// A fault of the rig ends it.
    Fault {
        /// What kind.
        kind: FaultKind,
        /// The device at fault, where one can be named.
        device: Option<Device>,
        /// In words, with its causes.
        fault: String,
    },
    /// How far it is.
    Progress {
        /// Steps with an accepted reading.
        done: usize,
        /// Steps of the plan.
        of: usize,
        /// Seconds of rig time still needed, as planned and corrected by what was measured so far.
        seconds_left: f64,
        /// Requests on the bus that had to be repeated so far.
        retries: u32,
    },
}
