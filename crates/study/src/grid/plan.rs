use pdv::Distribution;
use sweep::{Job, Model};

use crate::Error;

/// Which readings are taken: one cell of the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridPlan {
    /// θ_r of the planes, degrees.
    pub planes_deg: Vec<f64>,
    /// Readings of each plane.
    pub readings: usize,
    /// How their d_p are distributed.
    pub distribution: Distribution,
    /// Readings of the arc; 0: no arc.
    pub arc: usize,
    /// Rig seconds within which sweeps are added on the way; `None`: nothing is added.
    pub budget_s: Option<u32>,
}

impl GridPlan {
    /// What rows call the planes: "0 45 75".
    pub fn planes(&self) -> String {
        self.planes_deg
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(" ")
    }

    /// Readings of planes and arc together; a plan that grows has about four in a second.
    pub fn total(&self) -> usize {
        let fixed = self.planes_deg.len() * self.readings + self.arc;
        fixed.max(self.budget_s.map_or(0, |seconds| 4 * seconds as usize))
    }

    /// The job file that asks for it, checked as every job is.
    ///
    /// # Errors
    /// What a job file may not ask for.
    pub fn job(&self) -> Result<Job, Error> {
        let (readings, distribution) = (self.readings, self.distribution.name());
        let plane = |theta_r: &f64| {
            format!(
                "[[plane]]\ntheta_r_deg = {theta_r:?}\nreadings = {readings}\ndistribution = \"{distribution}\"\n"
            )
        };
        let mut text: String = self.planes_deg.iter().map(plane).collect();
        if self.arc > 0 {
            text += &format!("[arc]\nreadings = {}\n", self.arc);
        }
        if let Some(budget_s) = self.budget_s {
            text += &format!("[reconstruction]\nmodel = \"planes\"\n[sweep]\nbudget_s = {budget_s}.0\n");
        }
        let name = format!(
            "{} planes, {} readings, arc {}",
            self.planes(),
            self.readings,
            self.arc
        );
        Ok(Job::parse(&text, &name)?)
    }

    /// Whether a model has something of its own to say on it: one plane's models are made of one plane, and those of
    /// several are on a single plane what [`Model::Reciprocal`] is. What is added on the way is chosen for
    /// [`Model::Planes`].
    pub fn suits(&self, model: Model) -> bool {
        match self.planes_deg.len() {
            _ if self.budget_s.is_some() => model == Model::Planes,
            1 => model != Model::Planes,
            _ => !model.of_one_plane(),
        }
    }
}
