use pdv::{Distribution, Scene};
use serde::{Deserialize, Serialize};

use crate::{Leg, Specimen, Sweep};

/// The formats that a job may ask for; a test of `report` compares them with the crate `formats`.
pub const FORMATS: [&str; 12] = [
    "merl",
    "csv-long",
    "rgl-rgb",
    "rgl-spectral",
    "astm",
    "zemax",
    "ssdd",
    "pab-opto",
    "exr",
    "exr-half-difference",
    "materialx",
    "gltf",
];

/// What is to be measured, from a checked job file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Job {
    /// What messages call the job file.
    pub name: String,
    /// What lies on the stage.
    pub specimen: Specimen,
    /// Who measures, in their own words; empty where nothing is said.
    pub operator: String,
    /// What it is measured for, likewise.
    pub project: String,
    /// Whether that lies on the stage already, so that nobody need be asked before it is measured.
    pub on_stage: bool,
    /// Plane sweeps; at least one of planes and legs.
    pub planes: Vec<Plane>,
    /// Lines along which both arms move.
    pub legs: Vec<Leg>,
    /// The mirror arc.
    pub arc: Option<Arc>,
    /// How the arms take the readings.
    pub mode: Mode,
    /// How often each sweep is passed: 1, or in flight also 2, there and back.
    pub passes: usize,
    /// How the BRDF is made of the readings.
    pub model: Model,
    /// What will be looked at; `None`: everything.
    pub scene: Option<Scene>,
    /// Names of the file formats in which the result is written too, each once, from [`FORMATS`].
    pub formats: Vec<&'static str>,
    /// When to stop; `None`: when everything that the job names was measured. Else its planes and arc are the first, and
    /// what follows is decided on the way.
    pub until: Option<Until>,
}

impl Job {
    /// The curves of the job over the half angle, in the order in which models are made of them: its planes, then its legs.
    pub fn curves(&self) -> impl Iterator<Item = Sweep> + use<> {
        let planes = (0..self.planes.len()).map(Sweep::Plane);
        planes.chain((0..self.legs.len()).map(Sweep::Leg))
    }
}

/// When a run stops to which sweeps are added on the way. It also does where nothing is expected to gain any more.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Until {
    /// Expected MALE that is good enough, 1e-5 … 1.
    pub target_male: Option<f64>,
    /// Rig seconds of the whole run that may not be exceeded, 1 … 86 400.
    pub budget_s: Option<f64>,
}

/// How the arms take the readings of a sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// They stand still for each.
    #[default]
    Step,
    /// They fly through all of them.
    Fly,
}

impl Mode {
    /// As job files name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Step => "step",
            Self::Fly => "fly",
        }
    }
}

/// One plane sweep: the sensor stands at θ_r, the light crosses the plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Plane {
    /// Where the sensor stands, rad from the normal, 0 … below π/2.
    pub theta_r: f64,
    /// Readings over both sides of the mirror direction.
    pub readings: usize,
    /// How d_p is distributed.
    pub distribution: Distribution,
}

/// The mirror arc: light at −θ, sensor at +θ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Arc {
    /// Readings along the arc.
    pub readings: usize,
    /// Signed deviation from the mirror direction that the arc keeps, −1 … 1; 0 is the mirror direction itself.
    pub offset: f64,
}

/// Reconstruction model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// The paper's product F(θ_r)·G(d_p) in the logarithmic domain (Eq. 3).
    Separable,
    /// The first plane and the arc, reciprocally: a lobe over θ_h whose peak over θ_d is read on the arc, and a
    /// diffuse floor.
    Reciprocal,
    /// The same of all planes and the arc, interpolated between the planes. What a job gets that names no model.
    #[default]
    Planes,
    /// A table over half and difference angle of all planes and the arc (Romeiro 2008), a baseline.
    Bivariate,
    /// Of separable, bivariate and planes the one that best predicts readings from the others.
    Auto,
}

impl Model {
    /// As job files name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Separable => "separable",
            Self::Reciprocal => "reciprocal",
            Self::Planes => "planes",
            Self::Bivariate => "bivariate",
            Self::Auto => "auto",
        }
    }

    /// Whether it is made of the first plane and the arc alone, whatever else was measured.
    pub fn of_one_plane(self) -> bool {
        matches!(self, Self::Separable | Self::Reciprocal)
    }
}
