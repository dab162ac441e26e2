use serde::{Deserialize, Serialize};

/// A pair of directions of an isotropic BRDF in Projected Deviation Vector coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pdv {
    /// Zenith angle of the viewer and so of its mirror direction, rad, 0 … π/2.
    pub theta_r: f64,
    /// Length of the deviation from the mirror direction on the projected disk, 0 … 2.
    pub d_p: f64,
    /// Azimuth of the deviation, rad, −π … π; 0 points from the mirror direction across the normal.
    pub phi_p: f64,
}
