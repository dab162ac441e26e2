use brdf::Brdf;
use glam::DVec3;

use crate::model::Basis;
use crate::{Bivariate, Error, FactorTable, Model, Observation, Planes, Separable};

/// Whichever model predicts best what was read: every side of every plane in turn is left out, and predicted by each
/// model of the rest.
///
/// What is compared is mean |ln(1 + f̂ cos θ_i) − ln(1 + f cos θ_i)| over the readings that are left out. It says
/// nothing of what lies out of the plane, where no reading is. The four numbers of a [`Planes`] model's shape are chosen
/// once, from all readings, and not again for every side.
pub struct Auto {
    model: Box<dyn Model>,
    chosen: &'static str,
    /// Name and error of each candidate; `None` where it could not be tried.
    errors: Vec<(&'static str, Option<f64>)>,
}

impl Auto {
    /// Tries every model, and makes the best of all readings; the first, [`Planes`], where nothing can be told.
    ///
    /// # Errors
    /// As [`Planes::from_observations`].
    pub fn from_observations(planes: &[Vec<Observation>], arc: &[Observation]) -> Result<Self, Error> {
        let whole = Planes::from_observations(planes, arc)?;
        let folds = folds(planes);
        let errors = [
            ("planes", error(&folds, |rest| whole.surface_of(rest, arc))),
            (
                "bivariate",
                error(&folds, |rest| Bivariate::from_observations(rest, arc)),
            ),
            ("separable", error(&folds, |rest| separable(rest, arc))),
        ];
        let best = errors
            .iter()
            .filter_map(|(name, error)| Some((*name, (*error)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let chosen = best.map_or("planes", |(name, _)| name);
        let model: Box<dyn Model> = match chosen {
            "bivariate" => Box::new(Bivariate::from_observations(planes, arc)?),
            "separable" => Box::new(separable(planes, arc)?),
            _ => Box::new(whole),
        };
        Ok(Self {
            model,
            chosen,
            errors: errors.into(),
        })
    }

    /// Name of the model that was chosen.
    pub fn chosen(&self) -> &'static str {
        self.chosen
    }

    /// Name and error of every model that was tried; `None` where it could not be.
    pub fn errors(&self) -> &[(&'static str, Option<f64>)] {
        &self.errors
    }
}

/// The separable model of the first plane that has readings.
fn separable(planes: &[Vec<Observation>], arc: &[Observation]) -> Result<Separable, Error> {
    let first = planes.iter().find(|plane| !plane.is_empty());
    Separable::from_observations(first.map(Vec::as_slice).unwrap_or_default(), arc)
}

/// How far a model of the rest is from the readings that are left out; `None` where it cannot be made of every rest.
fn error<M: Brdf>(folds: &[Fold], model: impl Fn(&[Vec<Observation>]) -> Result<M, Error>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for (rest, left_out) in folds {
        let model = model(rest).ok()?;
        for reading in left_out {
            sum += miss(&model, reading)?;
            count += 1;
        }
    }
    (count > 0).then(|| sum / f64::from(count))
}

/// Planes without one side, and the readings of that.
type Fold = (Vec<Vec<Observation>>, Vec<Observation>);

/// For every side that can be spared the planes without it, and its readings.
fn folds(planes: &[Vec<Observation>]) -> Vec<Fold> {
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
fn miss(model: &impl Brdf, reading: &Observation) -> Option<f64> {
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
