use brdf::Brdf;
use glam::DVec3;

use crate::metric::absolute_log_error;
use crate::model::Basis;
use crate::{Bivariate, Error, FactorTable, Model, Observation, Planes, Separable};

/// [`Planes`] is left only for a model whose error is at most this share of its own.
///
/// What is held out lies in the plane, and most of what a model is for does not: on the fitted materials a share of 1 gives
/// up to 48 times the error of `planes`, of 0.8 up to 18 times, and from 0.6 on none is left for a worse one. Half is on
/// the safe side. `cargo run --release -p pdv --example auto_margin` finds it again.
const MARGIN: f64 = 0.5;

/// [`Planes`], unless another model predicts far better what was read: every side of every plane in turn is left out, and
/// predicted by each model of the rest.
///
/// What is compared is mean |ln(1 + f̂ cos θ_i) − ln(1 + f cos θ_i)| over the readings that are left out. It says
/// nothing of what lies out of the plane, where no reading is, and so another model is taken only where its error is at
/// most half of that of `planes`, and never with a single plane. The four numbers of a [`Planes`] model's shape are
/// chosen once, from all readings, and not again for every side.
///
/// ```
/// use brdf::Fitted;
/// use pdv::{Auto, Observation};
///
/// let gold = Fitted::named("gold-paint").expect("one of the fitted materials");
/// let plane = |theta_r: f64| -> Vec<_> {
///     let deviations = [-0.04, 0.0, 0.03, 0.1, 0.3, 0.7];
///     deviations.iter().filter_map(|&d| Observation::of(&gold, theta_r, d)).collect()
/// };
/// let arc: Vec<_> = [0.1, 0.6, 1.2].iter().filter_map(|&t| Observation::of(&gold, t, 0.0)).collect();
/// let auto = Auto::from_observations(&[plane(0.3), plane(1.0)], &arc)?;
/// assert_eq!(auto.chosen(), "planes");
/// # Ok::<(), pdv::Error>(())
/// ```
pub struct Auto {
    model: Box<dyn Model>,
    chosen: &'static str,
    /// Name and error of each candidate; `None` where it could not be tried.
    errors: Vec<(&'static str, Option<f64>)>,
}

impl Auto {
    /// Tries every model, and makes the one that is chosen of all readings.
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
        let chosen = chosen(planes, &errors);
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

/// The name of the model to take, of the errors of all; the first is [`Planes`].
fn chosen(planes: &[Vec<Observation>], errors: &[(&'static str, Option<f64>)]) -> &'static str {
    let usable = |o: &Observation| o.rgb.is_finite() && o.deviation.is_finite();
    let [(own, Some(error)), others @ ..] = errors else {
        return "planes";
    };
    if planes.iter().filter(|plane| plane.iter().any(usable)).count() < 2 {
        return own;
    }
    let best = others
        .iter()
        .filter_map(|(name, error)| Some((*name, (*error)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    // Where nothing is missed there is nothing to gain.
    best.filter(|(_, least)| *least <= MARGIN * error && *error > 0.0)
        .map_or(own, |(name, _)| name)
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
    let (read, found) = (reading.rgb.max(DVec3::ZERO), model.eval(incident, exitant));
    let channels = read.to_array().into_iter().zip(found.to_array());
    let miss: f64 = channels.map(|(f, g)| absolute_log_error(f, g, incident.z)).sum();
    Some(miss / 3.0)
}

impl Brdf for Auto {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        self.model.eval(incident, exitant)
    }

    fn eval_all(&self, incident: &[[f64; 3]], exitant: &[[f64; 3]], rgb: &mut [[f64; 3]]) {
        self.model.eval_all(incident, exitant, rgb);
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
        let why = if self.chosen == "planes" {
            "kept because no other predicts each side of each plane from the rest with half of its error, by the mean \
             difference of ln(1 + f cos)"
        } else {
            "chosen because it best predicts each side of each plane from the rest, with at most half of the error of \
             planes, by the mean difference of ln(1 + f cos)"
        };
        format!(
            "{}; {why}: {}",
            self.model.about(),
            tried.collect::<Vec<_>>().join(", ")
        )
    }

    fn factors(&self) -> Vec<FactorTable> {
        self.model.factors()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plane(theta_r: f64) -> Vec<Observation> {
        let reading = |deviation| Observation {
            theta_r,
            deviation,
            rgb: DVec3::ONE,
        };
        vec![reading(-0.1), reading(0.2)]
    }

    proptest! {
        /// Whatever the errors: `planes` is left with two planes or more, for the best of the others, by the margin.
        #[test]
        fn prop_planes_is_left_for_half_of_its_error_alone(
            errors in prop::array::uniform3(prop::option::of(prop_oneof![Just(0.0), 1e-9..1.0_f64])), planes in 0_usize..4,
        ) {
            let names = ["planes", "bivariate", "separable"];
            let errors: Vec<_> = names.into_iter().zip(errors).collect();
            let mut planes: Vec<_> = (0..planes).map(|n| plane(n as f64 * 0.3)).collect();
            // What was planned and not read is no plane.
            planes.push(Vec::new());
            let chosen = chosen(&planes, &errors);
            let least = errors[1..].iter().filter_map(|(_, error)| *error).fold(f64::INFINITY, f64::min);
            let own = errors[0].1;
            let far_better = own.is_some_and(|own| own > 0.0 && least <= MARGIN * own);
            prop_assert_eq!(chosen != "planes", planes.len() > 2 && far_better, "{}", chosen);
            let of_chosen = errors.iter().find(|(name, _)| *name == chosen).and_then(|(_, error)| *error);
            prop_assert!(chosen == "planes" || of_chosen == Some(least));
        }
    }
}
