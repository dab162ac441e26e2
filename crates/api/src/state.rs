use serde::{Deserialize, Serialize};

/// How a job stands. docs/architecture.md draws it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// It waits for its turn.
    Queued,
    /// Its turn has come; someone must say that its specimen is on the stage.
    AwaitingSpecimen,
    /// It is planned, measured or reported.
    Running,
    /// The arms hold, on an operator's wish.
    Paused,
    /// It was asked to end; the arms come to rest.
    Stopping,
    /// It ended before its last reading: stopped, by a fault, or with the program. What was measured is kept, and it
    /// goes on only when told to.
    Interrupted,
    /// Everything was measured and reported.
    Done,
    /// It never began, and cannot: this rig cannot do it.
    Failed,
    /// It was given up.
    Cancelled,
}

/// What happens to a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// Its turn has come, and its specimen is not on the stage yet.
    Turn,
    /// It starts: its specimen is on the stage.
    Start,
    /// The capture holds.
    Hold,
    /// The capture goes on.
    Proceed,
    /// It is asked to end.
    Halt,
    /// All was measured and reported.
    Complete,
    /// It ended before that, or the program did.
    Interrupt,
    /// It cannot be done at all.
    Fail,
    /// It is given up.
    Cancel,
    /// It goes on where it was interrupted.
    Resume,
}

impl JobState {
    /// The state after something happened; `None` where that cannot happen, or is not allowed, in this one.
    pub const fn after(self, cause: Cause) -> Option<Self> {
        use JobState::{
            AwaitingSpecimen, Cancelled, Done, Failed, Interrupted, Paused, Queued, Running, Stopping,
        };
        Some(match (self, cause) {
            (Queued, Cause::Turn) => AwaitingSpecimen,
            (Queued | AwaitingSpecimen, Cause::Start) | (Interrupted, Cause::Resume) => Running,
            (Running, Cause::Hold) => Paused,
            (Paused, Cause::Proceed) => Running,
            (Running | Paused | Stopping, Cause::Halt) => Stopping,
            (Running | Paused | Stopping, Cause::Complete) => Done,
            (Running | Paused | Stopping, Cause::Interrupt) => Interrupted,
            (Running | Stopping, Cause::Fail) => Failed,
            (Queued | AwaitingSpecimen | Interrupted, Cause::Cancel) => Cancelled,
            _ => return None,
        })
    }

    /// Whether the rig is busy with it.
    pub const fn under_way(self) -> bool {
        matches!(self, Self::Running | Self::Paused | Self::Stopping)
    }

    /// Whether nothing more will happen to it.
    pub const fn over(self) -> bool {
        matches!(self, Self::Done | Self::Failed | Self::Cancelled)
    }
}

impl std::fmt::Display for JobState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Queued => "queued",
            Self::AwaitingSpecimen => "awaiting specimen",
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Stopping => "stopping",
            Self::Interrupted => "interrupted",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATES: [JobState; 9] = [
        JobState::Queued,
        JobState::AwaitingSpecimen,
        JobState::Running,
        JobState::Paused,
        JobState::Stopping,
        JobState::Interrupted,
        JobState::Done,
        JobState::Failed,
        JobState::Cancelled,
    ];
    const CAUSES: [Cause; 10] = [
        Cause::Turn,
        Cause::Start,
        Cause::Hold,
        Cause::Proceed,
        Cause::Halt,
        Cause::Complete,
        Cause::Interrupt,
        Cause::Fail,
        Cause::Cancel,
        Cause::Resume,
    ];

    /// Every state (rows) under every cause (columns, in the order above).
    const TABLE: &str = "
        queued            | awaiting specimen running - - - - - - cancelled -
        awaiting specimen | - running - - - - - - cancelled -
        running           | - - paused - stopping done interrupted failed - -
        paused            | - - - running stopping done interrupted - - -
        stopping          | - - - - stopping done interrupted failed - -
        interrupted       | - - - - - - - - cancelled running
        done              | - - - - - - - - - -
        failed            | - - - - - - - - - -
        cancelled         | - - - - - - - - - -
    ";

    #[test]
    fn every_state_under_every_cause() {
        let row = |state: JobState| {
            let cells =
                CAUSES.map(|cause| state.after(cause).map_or("-".to_owned(), |next| next.to_string()));
            format!("{state} | {}", cells.join(" "))
        };
        let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let expected: Vec<String> = TABLE.lines().map(words).filter(|line| !line.is_empty()).collect();
        assert_eq!(STATES.map(row).to_vec(), expected);
    }

    #[test]
    fn only_a_new_specimen_or_an_operator_sets_a_waiting_job_off() {
        for state in STATES.into_iter().filter(|state| !state.under_way()) {
            for cause in CAUSES {
                if state.after(cause).is_some_and(JobState::under_way) {
                    assert!(
                        matches!(cause, Cause::Start | Cause::Resume),
                        "{state} under {cause:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_is_over_stays_over() {
        for state in STATES {
            assert_eq!(
                state.over(),
                CAUSES.iter().all(|&cause| state.after(cause).is_none()),
                "{state}"
            );
        }
    }
}
