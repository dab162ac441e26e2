use serde::{Deserialize, Serialize};

/// Where a reconstruction comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// The simulated rig, with all its imperfections.
    Rig,
    /// Readings of a perfect instrument, more than any rig would take: what the model cannot go below.
    Floor,
    /// Something else, which knows no rig: black, log-relative PCA.
    Baseline,
}

/// One reconstruction: a line of rows.csv, and but for `fit_s` of study.csv. What does not exist is empty.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GridRow {
    /// Which material.
    pub material: String,
    /// Where the readings come from.
    pub source: Source,
    /// θ_r of the planes in degrees, with spaces between.
    pub planes_deg: String,
    /// Readings asked for of each plane.
    pub readings: usize,
    /// Readings asked for of the arc.
    pub arc: usize,
    /// How the arms moved: "step at 60 °/s"; empty where there is no rig.
    pub motion: String,
    /// Rig seconds within which more was added on the way.
    pub budget_s: Option<u32>,
    /// Which model.
    pub model: String,
    /// Readings that counted.
    pub taken: usize,
    /// Exposures, with dark ones and those that were repeated.
    pub exposures: usize,
    /// Seconds that the simulated rig took.
    pub rig_s: Option<f64>,
    /// Seconds of one core that making the model took; they differ each time, so that nothing is made of them.
    pub fit_s: Option<f64>,
    /// See [`crate::Score`].
    pub male: f64,
    /// See [`crate::Score`].
    pub median_rel: f64,
    /// See [`crate::Score`].
    pub p95_rel: f64,
    /// Family of the material.
    pub family: String,
}

/// What tells a row from every other: material, source, planes, readings, arc, motion, budget and model.
pub(crate) type Key = (String, Source, String, usize, usize, String, Option<u32>, String);

impl GridRow {
    /// What tells it from every other row.
    pub(crate) fn key(&self) -> Key {
        (
            self.material.clone(),
            self.source,
            self.planes_deg.clone(),
            self.readings,
            self.arc,
            self.motion.clone(),
            self.budget_s,
            self.model.clone(),
        )
    }
}
