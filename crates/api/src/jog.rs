use serde::{Deserialize, Serialize};

/// Where to move one arm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Jog {
    /// Which arm.
    pub arm: ArmName,
    /// Where to, degrees from the normal, positive towards +x.
    #[cfg_attr(feature = "openapi", schema(minimum = -90, maximum = 90))]
    pub angle_deg: f64,
}

/// One of the arms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "lowercase")]
#[expect(
    missing_docs,
    reason = "the names say it, and the OpenAPI document has no more either"
)]
pub enum ArmName {
    Light,
    Sensor,
}
