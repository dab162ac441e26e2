use crate::{FaultId, FaultView, StoreError};

/// What kind of refusal, for whoever must act on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RefusalKind {
    /// There is no such thing.
    NotFound,
    /// Not in the present state of the job or the rig.
    Conflict,
    /// What was handed in is wrong.
    Invalid,
    /// Too much is waiting already; try again.
    Busy,
    /// The rig, the store or the daemon cannot at the moment.
    Unavailable,
}

/// Why the daemon does not do what it was asked to; nothing was changed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{why}")]
pub struct Refusal {
    /// Kind.
    pub kind: RefusalKind,
    /// In words, with what is allowed.
    pub why: String,
    /// The fault that is newer than the one that was to be acknowledged.
    pub newer: Option<Box<FaultView>>,
}

impl Refusal {
    pub(crate) fn new(kind: RefusalKind, why: impl Into<String>) -> Self {
        Self {
            kind,
            why: why.into(),
            newer: None,
        }
    }

    /// Another fault than `named` is the newest one.
    pub(crate) fn newer_fault(named: &FaultId, newest: FaultView) -> Self {
        Self {
            newer: Some(Box::new(newest.clone())),
            ..Self::conflict(format!(
                "fault {named} is not the newest: fault {} is ({}); look at the rig again",
                newest.id, newest.text
            ))
        }
    }

    pub(crate) fn conflict(why: impl Into<String>) -> Self {
        Self::new(RefusalKind::Conflict, why)
    }

    pub(crate) fn invalid(error: &dyn std::error::Error) -> Self {
        Self::new(RefusalKind::Invalid, chain(error))
    }

    pub(crate) fn unavailable(why: impl Into<String>) -> Self {
        Self::new(RefusalKind::Unavailable, why)
    }
}

impl From<StoreError> for Refusal {
    fn from(error: StoreError) -> Self {
        Self::unavailable(chain(&error))
    }
}

/// An error with its causes.
pub(crate) fn chain(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |error| error.source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}
