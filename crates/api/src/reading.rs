use serde::{Deserialize, Serialize};

/// A reading with what follows from it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ReadingView {
    /// Index of its step in the plan.
    pub step: usize,
    /// Exposures of this step before this one.
    pub attempt: u32,
    /// Whether it counts for its step.
    pub accepted: bool,
    /// What it belongs to: "plane 0", "arc", "dark", "repeat".
    pub sweep: String,
    /// Whether the lamp was on.
    pub lamp: bool,
    /// Light arm, measured, degrees.
    pub light_deg: f64,
    /// Sensor arm, measured, degrees.
    pub sensor_deg: f64,
    /// Zenith angle of the sensor, degrees.
    pub theta_r_deg: f64,
    /// Signed deviation from the mirror direction: |·| is d_p, positive towards the normal.
    pub deviation: f64,
    /// Counts of red, green, blue.
    pub counts: [u32; 3],
    /// Counts of the lamp monitor.
    pub monitor: u32,
    /// Gain factor.
    pub gain: u16,
    /// Integration time, µs.
    pub integration_us: u32,
    /// Temperature of the photometer, °C.
    pub temperature_c: u8,
    /// BRDF in sr⁻¹, red, green, blue, where the counts tell it.
    pub f: Option<[f64; 3]>,
    /// What to know about it.
    pub flags: Vec<String>,
    /// Seconds of rig time since the run began.
    pub time_s: f64,
}
