use brdf::Brdf;
use glam::DVec3;

use crate::model::Basis;
use crate::{Bivariate, Error, FactorTable, Model, Observation, Planes, Separable};

/// What can be chosen, the first where nothing can be told.
const CANDIDATES: [Candidate; 3] = [Candidate::Planes, Candidate::Bivariate, Candidate::Separable];

/// A kind of model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Candidate {
    Planes,
    Bivariate,
    Separable,
}

impl Candidate {
    fn name(self) -> &'static str {
        match self {
            Self::Planes => "planes",
            Self::Bivariate => "bivariate",
            Self::Separable => "separable",
        }
    }

    fn make(self, planes: &[Vec<Observation>], arc: &[Observation]) -> Result<Box<dyn Model>, Error> {
        Ok(match self {
            Self::Planes => Box::new(Planes::from_observations(planes, arc)?),
            Self::Bivariate => Box::new(Bivariate::from_observations(planes, arc)?),
            Self::Separable => {
                let first = planes.iter().find(|plane| !plane.is_empty());
                Box::new(Separable::from_observations(
                    first.map(Vec::as_slice).unwrap_or_default(),
                    arc,
                )?)
            }
        })
    }
}

/// Whichever model predicts best what was read: every side of every plane in turn is left out, and predicted by each
/// model of the rest.
///
/// What is compared is mean |ln(1 + f̂ cos θ_i) − ln(1 + f cos θ_i)| over the readings that are left out. It says
/// nothing of what lies out of the plane, where no reading is.
pub struct Auto {
    model: Box<dyn Model>,
    chosen: Candidate,
    /// Name and error of each candidate; `None` where it could not be tried.
    errors: Vec<(&'static str, Option<f64>)>,
}

impl Auto {
    /// Tries every model, and makes the best of all readings.
    ///
    /// # Errors
    /// As [`Planes::from_observations`].
    pub fn from_observations(planes: &[Vec<Observation>], arc: &[Observation]) -> Result<Self, Error> {
        let folds = folds(planes);
        let error = |candidate: Candidate| {
            let (mut sum, mut count) = (0.0, 0);
            for (rest, left_out) in &folds {
                let model = candidate.make(rest, arc).ok()?;
                for reading in left_out {
                    sum += miss(model.as_ref(), reading)?;
                    count += 1;
                }
            }
            (count > 0).then(|| sum / f64::from(count))
        };
        let errors: Vec<(Candidate, Option<f64>)> = CANDIDATES.map(|c| (c, error(c))).into();
        let best = errors
            .iter()
            .filter_map(|(candidate, error)| Some((*candidate, (*error)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let chosen = best.map_or(CANDIDATES[0], |(candidate, _)| candidate);
        Ok(Self {
            model: chosen.make(planes, arc)?,
            chosen,
            errors: errors.into_iter().map(|(c, error)| (c.name(), error)).collect(),
        })
    }

    /// Name of the model that was chosen.
    pub fn chosen(&self) -> &'static str {
        self.chosen.name()
    }

    /// Name and error of every model that was tried; `None` where it could not be.
    pub fn errors(&self) -> &[(&'static str, Option<f64>)] {
        &self.errors
    }
}

/// For every side that can be spared the planes without it, and its readings.
fn folds(planes: &[Vec<Observation>]) -> Vec<(Vec<Vec<Observation>>, Vec<Observation>)> {
    let mut folds = Vec::new();
    for n in 0..planes.len() {
        for sign in [1.0, -1.0] {
            let usable = |o: &&Observation| o.rgb.is_finite() && o.deviation.is_finite();
            let of_side = |o: &Observation| o.deviation * sign > 0.0;
            let left_out: Vec<_> = planes[n]
                .iter()
                .filter(usable)
                .filter(|o| of_side(o))
                .copied()
                .collect();
            let mut rest = planes.to_vec();
            rest[n].retain(|o| !of_side(o));
            let sides = |plane: &Vec<Observation>| plane.iter().any(|o| o.deviation != 0.0);
            if !left_out.is_empty() && rest.iter().any(sides) {
                folds.push((rest, left_out));
            }
        }
    }
    folds
}

/// How far a model is from a reading; `None` where no light can stand.
fn miss(model: &dyn Model, reading: &Observation) -> Option<f64> {
    let (incident, exitant) = reading.pdv().directions()?;
    let log = |f: DVec3| (f.max(DVec3::ZERO) * incident.z).map(f64::ln_1p);
    let miss = (log(model.eval(incident, exitant)) - log(reading.rgb)).abs();
    Some(miss.element_sum() / 3.0)
}

impl Brdf for Auto {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        self.model.eval(incident, exitant)
    }
}

impl Model for Auto {
    fn basis(&self, incident: DVec3, exitant: DVec3) -> Basis {
        self.model.basis(incident, exitant)
    }

    fn phi_p_constant(&self) -> bool {
        self.model.phi_p_constant()
    }

    fn about(&self) -> String {
        let tried = self.errors.iter().map(|(name, error)| {
            error.map_or_else(
                || format!("{name} not to be tried"),
                |error| format!("{name} {error:.5}"),
            )
        });
        format!(
            "{}; chosen because it best predicts each side of each plane from the rest, by the mean difference of \
             ln(1 + f cos): {}",
            self.model.about(),
            tried.collect::<Vec<_>>().join(", ")
        )
    }

    fn factors(&self) -> Vec<FactorTable> {
        self.model.factors()
    }
}
