use serde::{Deserialize, Serialize};

use crate::FaultId;

/// Which fault somebody has looked at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Acknowledgement {
    /// Id of the newest latched fault, as GET /rig shows it.
    #[cfg_attr(feature = "openapi", schema(value_type = String))]
    pub fault: FaultId,
}
