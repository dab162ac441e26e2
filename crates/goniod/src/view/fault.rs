use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A fault, latched until someone acknowledges it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct FaultView {
    /// Its code, which docs/operating.md explains.
    pub code: FaultCode,
    /// What happened, with its causes.
    pub text: String,
    /// When, RFC 3339, UTC.
    pub at: String,
    /// The run that it ended.
    pub run: Option<String>,
}

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
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
    /// The port is gone.
    Disconnected,
    /// A device is not what the rig file, or the run, says.
    Mismatch,
    /// The rig file, or its port, cannot be used.
    Setup,
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

impl From<rig::FaultKind> for FaultCode {
    fn from(kind: rig::FaultKind) -> Self {
        use rig::FaultKind as Kind;
        match kind {
            Kind::NoReply => Self::NoReply,
            Kind::Refused => Self::Refused,
            Kind::Hardware => Self::Hardware,
            Kind::Motion => Self::Motion,
            Kind::Disconnected => Self::Disconnected,
            Kind::Mismatch => Self::Mismatch,
            _ => Self::Setup,
        }
    }
}
