use serde::{Deserialize, Serialize};

/// Which cosine the signal carries (Nicodemus; see docs/geometry.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filling {
    /// The light overfills what the sensor sees: signal ~ f · cos θ_i.
    Over,
    /// The light's spot lies within what the sensor sees: signal ~ f · cos θ_o.
    Under,
}

/// Constants between counts and sr⁻¹; `[calibration]` of the rig file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Which cosine the signal carries.
    pub filling: Filling,
    /// Counts per µs at gain ×1 for f·cos = 1 sr⁻¹ at nominal lamp output; red, green, blue.
    pub responsivity: [f64; 3],
    /// Monitor counts per µs at nominal lamp output.
    pub monitor: f64,
}
