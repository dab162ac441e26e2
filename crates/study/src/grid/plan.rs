use arms::Profile;
use pdv::Distribution;
use rig::RigFile;
use sweep::{Job, Mode, Model};

use crate::Error;

/// Seconds in which the arms speed up: as the built-in rig file has it, 60 °/s at 200 °/s².
const RAMP_S: f64 = 0.3;

/// Which readings are taken: one cell of the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridPlan {
    /// θ_r of the planes, degrees.
    pub planes_deg: Vec<f64>,
    /// Legs of a snake, instead of planes; 0: none.
    pub snake: usize,
    /// Readings of each plane; of a snake as many as its flight can take.
    pub readings: usize,
    /// How their d_p are distributed.
    pub distribution: Distribution,
    /// Readings of the arc; 0: no arc.
    pub arc: usize,
    /// How the arms take them.
    pub mode: Mode,
    /// Cruising speed of both arms, degrees/s; they speed up to it in three tenths of a second.
    pub speed_deg_s: u32,
    /// Rig seconds within which sweeps are added on the way; `None`: nothing is added.
    pub budget_s: Option<u32>,
}

impl GridPlan {
    /// What rows call the curves: "0 45 75", "snake of 6".
    pub fn planes(&self) -> String {
        if self.snake > 0 {
            return format!("snake of {}", self.snake);
        }
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
        if self.snake > 0 {
            text += &format!("[snake]\nlegs = {}\n", self.snake);
        }
        if self.arc > 0 {
            text += &format!("[arc]\nreadings = {}\n", self.arc);
        }
        if let Some(budget_s) = self.budget_s {
            text += &format!("[reconstruction]\nmodel = \"planes\"\n[sweep]\nbudget_s = {budget_s}.0\n");
        } else {
            text += "[sweep]\n";
        }
        text += &format!("mode = \"{}\"\n", self.mode.name());
        let name = format!(
            "{} planes, {} readings, arc {}, {}",
            self.planes(),
            self.readings,
            self.arc,
            self.motion()
        );
        Ok(Job::parse(&text, &name)?)
    }

    /// What rows call the motion: "step at 60 °/s".
    pub fn motion(&self) -> String {
        format!("{} at {} °/s", self.mode.name(), self.speed_deg_s)
    }

    /// The rig file whose arms move so fast.
    pub(crate) fn rig(&self) -> Result<RigFile, Error> {
        let mut rig = RigFile::parse(RigFile::BUILT_IN, "the built-in rig file".as_ref())?;
        for arm in &mut rig.arms {
            let velocity_rad_s = f64::from(self.speed_deg_s).to_radians();
            arm.profile = arm.axis.quantised(Profile {
                velocity_rad_s,
                acceleration_rad_s2: velocity_rad_s / RAMP_S,
            });
        }
        Ok(rig)
    }

    /// Whether a model has something of its own to say on it: one plane's models are made of one plane, and those of
    /// several are on a single plane what [`Model::Reciprocal`] is. What is added on the way is chosen for
    /// [`Model::Planes`].
    pub fn suits(&self, model: Model) -> bool {
        match self.planes_deg.len() {
            _ if self.budget_s.is_some() || self.snake > 0 => model == Model::Planes,
            1 => model != Model::Planes,
            _ => !model.of_one_plane(),
        }
    }
}
