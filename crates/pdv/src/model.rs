use brdf::Brdf;
use glam::DVec3;

/// A BRDF that was made of the readings of a few sweeps.
pub trait Model: Brdf {
    /// Whether the answer for these unit vectors rests on nothing that was measured: θ_r or d_p lies beyond the
    /// range of a factor.
    fn extrapolated(&self, incident: DVec3, exitant: DVec3) -> bool;

    /// What it is and how it was made, in words, to follow "it is": no capital, no full stop.
    fn about(&self) -> String;

    /// The one-dimensional factors, for people and files.
    fn factors(&self) -> Vec<FactorTable>;
}

/// A factor as a table.
#[derive(Clone, Debug, PartialEq)]
pub struct FactorTable {
    /// Name, e.g. "G".
    pub name: &'static str,
    /// Name of the variable with its unit, e.g. "theta_r_deg".
    pub variable: &'static str,
    /// Variable and RGB value, ascending.
    pub rows: Vec<(f64, DVec3)>,
}
