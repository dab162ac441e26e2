use brdf::Brdf;
use glam::DVec3;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::bisected::{Bisected, Pair};
use crate::model::Basis;
use crate::{FactorTable, Model, WedgeReading};

/// The least reflectance, sr⁻¹, that has a logarithm.
const LEAST: f64 = 1e-9;
/// Cosine of 80°: beyond it f rises so steeply, and an instrument errs so much, that a reading says nothing of what lies below.
const LEAST_COSINE: f64 = 0.173_648;
/// What a reading may ask for and what a pair may get, in ln f: a factor of 4.5.
const MOST: f64 = 1.5;
/// What a reading tells however far it lies from a pair, as a share of what it tells at its own place.
const EVERYWHERE: f64 = 0.2;
/// How far a reading tells more than that, rad of half and difference angle.
const REACH: f64 = 0.25;
/// By how much ln f of a reading is not believed.
const NOISE: f64 = 0.1;

/// A model that readings of the specimen on wedges correct out of the plane; in the plane it stays as it is.
///
/// With E = sin² θ_h sin² θ_d sin² φ_d, which is 0 in the plane and sin² τ sin² δ for arms that stand 2δ apart over a wedge
/// of tilt τ, f' = f̂ exp(E g), and g over half and difference angle is what explains best, channel by channel, how far
/// the readings are from the model: a Gaussian process with the covariance 0.2 + 0.8 exp(−(Δθ_h² + Δθ_d²)/(2·0.25²)) and
/// 0.1 of noise in ln f. What a reading says and what a pair gets is at most a factor of 4.5. E, θ_h and θ_d are the same
/// with light and viewer swapped, so that f' is reciprocal where f̂ is; it is 0 where f̂ is 0 and positive where f̂ is.
///
/// ```
/// # use pdv::Observation;
/// # let gold = brdf::Fitted::named("gold-paint").expect("one of the fitted materials");
/// # let plane = |theta_r: f64| -> Vec<Observation> {
/// #     let deviations = [-0.04, 0.0, 0.02, 0.06, 0.15, 0.4, 0.8];
/// #     deviations.iter().filter_map(|&d| Observation::of(&gold, theta_r, d)).collect()
/// # };
/// # let arc: Vec<_> = [0.1, 0.5, 0.9, 1.3].iter().filter_map(|&t| Observation::of(&gold, t, 0.0)).collect();
/// use brdf::Brdf;
/// use pdv::{Corrected, Placement, Planes, WedgeReading};
///
/// let wedge = Placement { tilt: 0.5, ..Placement::FLAT };
/// let beyond: Vec<_> = [0.3, 0.7, 1.0].iter()
///     .filter_map(|&delta| WedgeReading::of(&gold, &wedge, -delta, delta))
///     .collect();
/// let plain = Planes::from_observations(&[plane(0.3), plane(1.0)], &arc)?;
/// let miss = |f: glam::DVec3| (f.x / beyond[1].rgb.x).ln().abs();
/// let before = miss(plain.eval(beyond[1].incident, beyond[1].exitant));
/// let corrected = Corrected::new(Box::new(plain), &beyond);
/// assert!(miss(corrected.eval(beyond[1].incident, beyond[1].exitant)) < before);
/// # Ok::<(), pdv::Error>(())
/// ```
pub struct Corrected {
    model: Box<dyn Model>,
    nodes: Vec<Node>,
    check: Check,
}

/// What wedge readings say of the model that they correct: means of |ln(f/f̂)| over them and the channels, each reading's at
/// most 1.5, where f and f̂ are above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Check {
    /// Readings that the correction is made of.
    pub readings: usize,
    /// Readings that were not finite, had a direction beyond 80°, or lay in the plane and so tell nothing.
    pub dropped: usize,
    /// How far the model was from them; `None` where no channel of any reading can be compared.
    pub before: Option<f64>,
    /// How far it is when each is predicted with the help of the others.
    pub foretold: Option<f64>,
    /// How far it is with all of them.
    pub after: Option<f64>,
}

/// A reading's place, and its share of g for each channel.
#[derive(Clone, Copy, Debug)]
struct Node {
    at: Bisected,
    weight: DVec3,
}

/// A reading's place, E there, and what it asks for.
struct Asked {
    at: Bisected,
    out: f64,
    /// ln(f/f̂), at most [`MOST`]; NaN in a channel in which the model is black.
    log: DVec3,
}

impl Asked {
    /// `None` of what tells nothing.
    fn new(model: &dyn Model, reading: &WedgeReading) -> Option<Self> {
        let WedgeReading {
            incident,
            exitant,
            rgb,
        } = *reading;
        let finite = incident.is_finite() && exitant.is_finite() && rgb.is_finite();
        if !finite || incident.z.min(exitant.z) < LEAST_COSINE || !model.valid(incident, exitant) {
            return None;
        }
        let pair = Pair::new(incident, exitant);
        let found = model.eval(incident, exitant);
        let log = |c: usize| {
            if found[c] > LEAST {
                (rgb[c].max(LEAST) / found[c]).ln().clamp(-MOST, MOST)
            } else {
                f64::NAN
            }
        };
        (pair.out > 0.0).then(|| Self {
            at: pair.bisected(),
            out: pair.out,
            log: DVec3::new(log(0), log(1), log(2)),
        })
    }
}

impl Corrected {
    /// Corrects a model by readings; those that tell nothing are dropped and counted. Without any it is the model itself.
    pub fn new(model: Box<dyn Model>, readings: &[WedgeReading]) -> Self {
        let asked: Vec<Asked> = readings
            .iter()
            .filter_map(|reading| Asked::new(model.as_ref(), reading))
            .collect();
        let mut nodes: Vec<Node> = asked
            .iter()
            .map(|asked| Node {
                at: asked.at,
                weight: DVec3::ZERO,
            })
            .collect();
        let mut misses = Misses::default();
        for channel in 0..3 {
            // A channel in which the model is black at a reading learns nothing of it.
            let told: Vec<usize> = (0..asked.len())
                .filter(|&n| asked[n].log[channel].is_finite())
                .collect();
            let explained = Explained::new(&asked, &told, channel);
            for (&n, &weight) in told.iter().zip(&explained.weights) {
                nodes[n].weight[channel] = asked[n].out * weight;
            }
            misses.add(&explained);
        }
        Self {
            check: misses.check(asked.len(), readings.len() - asked.len()),
            model,
            nodes,
        }
    }

    /// What the readings say of the model.
    pub fn check(&self) -> Check {
        self.check
    }

    /// The factor that a pair gets, for each channel.
    fn factor(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        let pair = Pair::new(incident, exitant);
        let at = pair.bisected();
        let shares = self.nodes.iter().map(|node| node.weight * alike(at, node.at));
        let log = pair.out * shares.sum::<DVec3>();
        log.clamp(DVec3::splat(-MOST), DVec3::splat(MOST)).exp()
    }
}

/// How much of g two places have in common.
fn alike(a: Bisected, b: Bisected) -> f64 {
    let (h, d) = (a.theta_h - b.theta_h, a.theta_d - b.theta_d);
    EVERYWHERE + (1.0 - EVERYWHERE) * (-(h * h + d * d) / (2.0 * REACH * REACH)).exp()
}

/// What explains one channel of some readings best.
struct Explained {
    /// (K + σ²)⁻¹ r.
    weights: Vec<f64>,
    before: Vec<f64>,
    /// What is left of each with the help of the others alone.
    foretold: Vec<f64>,
    after: Vec<f64>,
}

impl Explained {
    fn new(asked: &[Asked], told: &[usize], channel: usize) -> Self {
        let before: Vec<f64> = told.iter().map(|&n| asked[n].log[channel]).collect();
        let covariance = DMatrix::from_fn(told.len(), told.len(), |j, k| {
            let (a, b) = (&asked[told[j]], &asked[told[k]]);
            let noise = if j == k { NOISE * NOISE } else { 0.0 };
            a.out * b.out * alike(a.at, b.at) + noise
        });
        let factored: Cholesky<f64, Dyn> =
            Cholesky::new(covariance).expect("a covariance and noise on its diagonal are positive definite");
        let weights: Vec<f64> = factored
            .solve(&DVector::from_column_slice(&before))
            .iter()
            .copied()
            .collect();
        let inverse = factored.inverse();
        let foretold = weights
            .iter()
            .enumerate()
            .map(|(n, weight)| weight / inverse[(n, n)]);
        // r − K (K + σ²)⁻¹ r = σ² (K + σ²)⁻¹ r.
        let after = weights.iter().map(|weight| NOISE * NOISE * weight);
        Self {
            foretold: foretold.collect(),
            after: after.collect(),
            weights,
            before,
        }
    }
}

/// Sums of the sizes of what is left.
#[derive(Default)]
struct Misses {
    count: usize,
    before: f64,
    foretold: f64,
    after: f64,
}

impl Misses {
    fn add(&mut self, explained: &Explained) {
        let sum = |of: &[f64]| of.iter().map(|miss| miss.abs()).sum::<f64>();
        self.count += explained.before.len();
        self.before += sum(&explained.before);
        self.foretold += sum(&explained.foretold);
        self.after += sum(&explained.after);
    }

    fn check(&self, readings: usize, dropped: usize) -> Check {
        let mean = |sum: f64| (self.count > 0).then(|| sum / self.count as f64);
        Check {
            readings,
            dropped,
            before: mean(self.before),
            foretold: mean(self.foretold),
            after: mean(self.after),
        }
    }
}

impl Brdf for Corrected {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        let found = self.model.eval(incident, exitant);
        if incident.z > 0.0 && exitant.z > 0.0 {
            found * self.factor(incident, exitant)
        } else {
            found
        }
    }

    fn valid(&self, incident: DVec3, exitant: DVec3) -> bool {
        self.model.valid(incident, exitant)
    }
}

impl Model for Corrected {
    fn basis(&self, incident: DVec3, exitant: DVec3) -> Basis {
        self.model.basis(incident, exitant)
    }

    fn about(&self) -> String {
        let Check {
            readings,
            before,
            foretold,
            after,
            ..
        } = self.check;
        let [before, foretold, after] = [before, foretold, after].map(Option::unwrap_or_default);
        format!(
            "{}; corrected out of the plane by {readings} readings on wedges, from which it was {before:.3} of ln f away, \
             {foretold:.3} when each is predicted from the others, and is {after:.3} now",
            self.model.about()
        )
    }

    fn factors(&self) -> Vec<FactorTable> {
        self.model.factors()
    }
}

#[cfg(test)]
mod tests;
