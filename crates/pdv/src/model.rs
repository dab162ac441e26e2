use brdf::Brdf;
use glam::DVec3;
use serde::Serialize;

/// A BRDF that was made of the readings of a few sweeps.
pub trait Model: Brdf {
    /// What the answer for these unit vectors rests on.
    fn basis(&self, incident: DVec3, exitant: DVec3) -> Basis;

    /// Whether the answer for these unit vectors rests on nothing that was measured.
    fn extrapolated(&self, incident: DVec3, exitant: DVec3) -> bool {
        self.basis(incident, exitant) != Basis::Interpolated
    }

    /// Whether f is constant along φ_p, so that its directional albedo is a one-dimensional integral.
    fn phi_p_constant(&self) -> bool {
        false
    }

    /// What it is and how it was made, in words, to follow "it is": no capital, no full stop.
    fn about(&self) -> String;

    /// The one-dimensional factors, for people and files.
    fn factors(&self) -> Vec<FactorTable>;
}

/// What the answer of a model rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Basis {
    /// Both factors were read around it.
    Interpolated,
    /// It lies beyond the range of a factor, or in a gap that the readings leave about retro-reflection. Why nothing was
    /// read there a model cannot know.
    Extrapolated,
    /// It lies outside of what the job's scene asks for, so that nothing was read for it.
    NotMeasured,
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
