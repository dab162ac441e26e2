use std::borrow::Cow;
use std::f64::consts::TAU;

use brdf::{Brdf, Spherical};
use glam::DVec3;
use pdv::Draw;
use pdv::metric::{absolute_log_error, quantile, relative_error};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::Material;

/// Pairs of directions, drawn once, on which many estimates are judged.
#[derive(Clone, Debug)]
pub(crate) struct Judge {
    pairs: Vec<(DVec3, DVec3)>,
}

/// How far an estimate is from a reference, channels pooled; as in [`pdv::Metrics`], quantiles exact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Mean |ln(1 + f cos θ_i) − ln(1 + f̂ cos θ_i)|.
    pub male: f64,
    /// Median of |f̂ − f|/max(f, 1e-3 sr⁻¹).
    pub median_rel: f64,
    /// 95th percentile of the same.
    pub p95_rel: f64,
}

impl Judge {
    /// θ_i, θ_o and the azimuth between them evenly, from one stream of random numbers.
    pub(crate) fn new(draw: &Draw) -> Self {
        Self::stream(draw, 0)
    }

    /// The same from another stream of the same seed.
    pub(crate) fn stream(draw: &Draw, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(draw.seed);
        rng.set_stream(stream);
        let mut direction = |turned: f64| {
            let theta = rng.random::<f64>() * draw.theta_max;
            let phi = rng.random::<f64>() * TAU * turned;
            Spherical { theta, phi }.direction()
        };
        let pairs = (0..draw.pairs).map(|_| (direction(1.0), direction(0.0)));
        Self {
            pairs: pairs.collect(),
        }
    }

    /// Pairs in one plane with the normal, light and viewer on either side of it.
    pub(crate) fn in_plane(draw: &Draw) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(draw.seed);
        let mut direction = || {
            let theta = (2.0 * rng.random::<f64>() - 1.0) * draw.theta_max;
            DVec3::new(theta.sin(), 0.0, theta.cos())
        };
        Self {
            pairs: (0..draw.pairs).map(|_| (direction(), direction())).collect(),
        }
    }

    /// On which pairs a material is judged, and what it is there: these, or where scattered readings are all that is known
    /// of it, those with both angles up to `theta_max`, rad.
    pub(crate) fn of<'a>(&'a self, material: &Material, theta_max: f64) -> (Cow<'a, Self>, Vec<DVec3>) {
        let Some(readings) = &material.known else {
            return (Cow::Borrowed(self), self.values(material.brdf.as_ref()));
        };
        let below = readings
            .iter()
            .filter(|reading| reading.light.max(reading.sensor) <= theta_max);
        let (pairs, values) = below
            .map(|reading| (reading.directions(), reading.rgb.max(DVec3::ZERO)))
            .unzip();
        (Cow::Owned(Self { pairs }), values)
    }

    pub(crate) fn pairs(&self) -> &[(DVec3, DVec3)] {
        &self.pairs
    }

    /// Values of a BRDF at every pair.
    pub(crate) fn values(&self, brdf: &(impl Brdf + ?Sized)) -> Vec<DVec3> {
        self.pairs.iter().map(|&(i, o)| brdf.eval(i, o)).collect()
    }

    /// The score of values at every pair.
    pub(crate) fn score(&self, reference: &[DVec3], estimate: &[DVec3]) -> Score {
        let mut male = 0.0;
        let mut relative = Vec::with_capacity(3 * reference.len());
        for (((incident, _), f), g) in self.pairs.iter().zip(reference).zip(estimate) {
            for (f, g) in f.to_array().into_iter().zip(g.to_array()) {
                male += absolute_log_error(f, g, incident.z);
                relative.push(relative_error(f, g));
            }
        }
        let n = relative.len();
        let mut quantile = |q: f64| quantile(&mut relative, q).expect("there are pairs");
        Score {
            male: male / n as f64,
            median_rel: quantile(0.5),
            p95_rel: quantile(0.95),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use brdf::Fitted;

    #[test]
    fn agrees_with_the_metrics_of_a_run() {
        let draw = Draw {
            pairs: 100_000,
            ..Draw::default()
        };
        let (gold, brass) = (Fitted::named("gold-paint"), Fitted::named("brass"));
        let (gold, brass) = (gold.unwrap(), brass.unwrap());
        let judge = Judge::new(&draw);
        let score = judge.score(&judge.values(&gold), &judge.values(&brass));
        let metrics = pdv::compare(&gold, &[&brass], &draw)[0].overall;
        // Other random numbers, so 1/√pairs apart.
        for (ours, theirs) in [
            (score.male, metrics.male),
            (score.median_rel, metrics.median_rel),
            (score.p95_rel, metrics.p95_rel),
        ] {
            let theirs = theirs.unwrap();
            assert!((ours / theirs - 1.0).abs() < 0.02, "{ours}, not {theirs}");
        }
    }
}
