use serde::{Deserialize, Serialize};
use ulid::Ulid;

/// Id of a fault: a ULID, never reused. Every press of the emergency stop has a new one.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "openapi", schema(value_type = String, example = "01KAGN4Z7Q3X9V5T8R2M6C1D0B"))]
pub struct FaultId(String);

impl FaultId {
    /// A new id.
    pub fn generate() -> Self {
        Self(Ulid::generate().to_string())
    }
}

impl std::fmt::Display for FaultId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl From<String> for FaultId {
    /// The name that somebody gives a fault; whether there is one of that name is for the daemon to say.
    fn from(name: String) -> Self {
        Self(name)
    }
}

/// A fault, latched until someone acknowledges it by its id.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct FaultView {
    /// Its id, which an acknowledgement names.
    #[serde(default = "FaultId::generate")]
    pub id: FaultId,
    /// Its code, which docs/operating.md explains.
    pub code: FaultCode,
    /// What happened, with its causes.
    pub text: String,
    /// What to do about it, as docs/operating.md says; `None` where a version before kept it.
    #[serde(default)]
    pub remedy: Option<String>,
    /// When, RFC 3339, UTC.
    pub at: String,
    /// The run that it ended.
    pub run: Option<String>,
}

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum FaultCode {
    /// Someone pressed the emergency stop.
    Estop,
    /// A device gives no good reply.
    NoReply,
    /// A device refused a request, or a motion would leave the envelope.
    Refused,
    /// A device reports a hardware error.
    Hardware,
    /// An arm did not do what it was told.
    Motion,
    /// Light gets in from outside.
    Light,
    /// The port is gone.
    Disconnected,
    /// A device is not what the rig file, or the run, says.
    Mismatch,
    /// The rig file, or its port, cannot be used.
    Setup,
    /// This computer slept, or the daemon was stopped, for longer than the watchdogs wait.
    StoodStill,
    /// The disk is full.
    DiskFull,
    /// Another program keeps the store locked.
    StoreLocked,
    /// The store may not be written.
    ReadOnly,
    /// The disk, or its file system, refuses for a reason of its own.
    DiskError,
    /// The store cannot be read or written for another reason, such as damage.
    Store,
    /// Results cannot be written.
    Report,
}

impl std::fmt::Display for FaultCode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Estop => "estop",
            Self::NoReply => "no_reply",
            Self::Refused => "refused",
            Self::Hardware => "hardware",
            Self::Motion => "motion",
            Self::Light => "light",
            Self::Disconnected => "disconnected",
            Self::Mismatch => "mismatch",
            Self::Setup => "setup",
            Self::StoodStill => "stood_still",
            Self::DiskFull => "disk_full",
            Self::StoreLocked => "store_locked",
            Self::ReadOnly => "read_only",
            Self::DiskError => "disk_error",
            Self::Store => "store",
            Self::Report => "report",
        })
    }
}
