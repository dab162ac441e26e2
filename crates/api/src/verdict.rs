use serde::{Deserialize, Serialize};

/// What the checks say of a run's result as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum VerdictView {
    /// Nobody can tell: the run is not complete.
    Unknown,
    /// As it should be.
    Good,
    /// Worth a look before it is used.
    Look,
    /// It must not be used: there is no reconstruction, or something in it cannot be true. report.json says why.
    Bad,
}
