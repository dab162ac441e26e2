use std::f64::consts::TAU;

use brdf::{Brdf, Spherical};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use crate::quantile::Quantiles;
use crate::{Cell, Scene};

/// Floor of relative errors, sr⁻¹: what a photometer of this kind can tell from nothing.
const FLOOR: f64 = 1e-3;
/// ε of the log-relative mapping (Nielsen, Jensen, Ramamoorthi 2015), in sr⁻¹ and for the cosine weight.
const EPSILON: f64 = 1e-3;
/// Streams of random numbers; fixed, so that the result does not depend on the number of cores.
const STREAMS: u64 = 32;

/// Which pairs of directions are compared: θ_i, θ_o and the azimuth between them are drawn evenly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Draw {
    /// Number of pairs.
    pub pairs: u64,
    /// Largest zenith angle of either direction, rad.
    pub theta_max: f64,
    /// Seed of the draw.
    pub seed: u64,
}

impl Default for Draw {
    /// A million pairs below 80°.
    fn default() -> Self {
        Self {
            pairs: 1_000_000,
            theta_max: 80.0_f64.to_radians(),
            seed: 1,
        }
    }
}

/// How far an estimate is from a reference.
///
/// All over the pairs that are valid in both. `None` where no pair is left.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// MALE: mean |ln(1 + f cos θ_i) − ln(1 + f̂ cos θ_i)|.
    pub male: Option<f64>,
    /// Median of |f̂ − f|/max(f, 1e-3 sr⁻¹), to 0.2 % of itself.
    pub median_rel: Option<f64>,
    /// 95th percentile of the same.
    pub p95_rel: Option<f64>,
    /// Root mean square of the same.
    pub rel_rms: Option<f64>,
    /// Root mean square of ln((f̂ w + ε)/(f w + ε)), w = max(cos θ_i cos θ_o, ε), ε = 1e-3.
    pub log_rel_rmse: Option<f64>,
    /// Eq. 4 of the paper, relRMS/√N without a floor. It shrinks with N whatever the estimate: see `eq4_black`.
    pub eq4: Option<f64>,
    /// What an all-zero estimate scores in Eq. 4: 1/√N.
    pub eq4_black: Option<f64>,
    /// N: pairs of Eq. 4, valid in both and with a reference above 0.
    pub pairs: u64,
    /// Share of the drawn pairs that are not among those N.
    pub left_out: f64,
}

/// Metrics per channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Channels {
    /// Red.
    pub r: Metrics,
    /// Green.
    pub g: Metrics,
    /// Blue.
    pub b: Metrics,
}

/// An estimate compared with a reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The three channels pooled; N is their mean.
    #[serde(flatten)]
    pub overall: Metrics,
    /// Each by itself.
    pub channels: Channels,
    /// Which pairs were drawn.
    pub draw: Draw,
}

/// Compares estimates with a reference over the same pairs, which are drawn once; on all cores, in constant memory.
///
/// The result depends on the draw alone, not on the number of cores.
pub fn compare(reference: &(impl Brdf + ?Sized), estimates: &[&dyn Brdf], draw: &Draw) -> Vec<Comparison> {
    compare_within(&Scene::whole(), reference, estimates, draw)
}

/// The same over the pairs of a scene alone: its cells are drawn by their weights, and θ_i and θ_o evenly in each.
///
/// Where the whole scene lies beyond `draw.theta_max`, it is taken as it is. Its channels do not matter here.
pub fn compare_within(
    scene: &Scene,
    reference: &(impl Brdf + ?Sized),
    estimates: &[&dyn Brdf],
    draw: &Draw,
) -> Vec<Comparison> {
    let cells = scene.below(draw.theta_max);
    let streams: Vec<Vec<[Sums; 3]>> = (0..STREAMS)
        .into_par_iter()
        .map(|stream| {
            let mut rng = ChaCha8Rng::seed_from_u64(draw.seed);
            rng.set_stream(stream);
            let share = draw.pairs / STREAMS + u64::from(stream < draw.pairs % STREAMS);
            let mut sums: Vec<[Sums; 3]> = estimates.iter().map(|_| [(); 3].map(|()| Sums::new())).collect();
            for _ in 0..share {
                let cell = drawn(&cells, &mut rng);
                let mut within = |[low, high]: [f64; 2]| low + rng.random::<f64>() * (high - low);
                let (theta_i, theta_o) = (within(cell.theta_i), within(cell.theta_o));
                let incident = Spherical {
                    theta: theta_i,
                    phi: rng.random::<f64>() * TAU,
                }
                .direction();
                let exitant = Spherical {
                    theta: theta_o,
                    phi: 0.0,
                }
                .direction();
                add(reference, estimates, incident, exitant, &mut sums);
            }
            sums
        })
        .collect();
    (0..estimates.len())
        .map(|n| {
            let mut channels = [(); 3].map(|()| Sums::new());
            for stream in &streams {
                channels
                    .iter_mut()
                    .zip(&stream[n])
                    .for_each(|(sum, part)| sum.merge(part));
            }
            let mut overall = Sums::new();
            channels.iter().for_each(|channel| overall.merge(channel));
            let [r, g, b] = channels.map(|channel| channel.metrics(draw.pairs, 1));
            Comparison {
                overall: overall.metrics(draw.pairs, 3),
                channels: Channels { r, g, b },
                draw: *draw,
            }
        })
        .collect()
}

/// One of some cells by their weights.
fn drawn<'a>(cells: &'a [Cell], rng: &mut ChaCha8Rng) -> &'a Cell {
    let [cell] = cells else {
        let all: f64 = cells.iter().map(|cell| cell.weight).sum();
        let mut left = rng.random::<f64>() * all;
        let drawn = cells.iter().find(|cell| {
            left -= cell.weight;
            left < 0.0
        });
        // Rounding may leave a little.
        return drawn.or(cells.last()).unwrap_or(&Cell::WHOLE);
    };
    cell
}

#[inline]
fn add(
    reference: &(impl Brdf + ?Sized),
    estimates: &[&dyn Brdf],
    incident: DVec3,
    exitant: DVec3,
    sums: &mut [[Sums; 3]],
) {
    if !reference.valid(incident, exitant) {
        return;
    }
    let f = reference.eval(incident, exitant).to_array();
    let weight = (incident.z * exitant.z).max(EPSILON);
    for (estimate, sums) in estimates.iter().zip(sums) {
        if estimate.valid(incident, exitant) {
            let g = estimate.eval(incident, exitant).to_array();
            for (sums, (f, g)) in sums.iter_mut().zip(f.into_iter().zip(g)) {
                sums.add(f, g, incident.z, weight);
            }
        }
    }
}

/// Running sums of one channel.
struct Sums {
    valid: u64,
    male: f64,
    squares: f64,
    log_squares: f64,
    relative: Quantiles,
    positive: u64,
    squares_without_floor: f64,
}

impl Sums {
    fn new() -> Self {
        Self {
            valid: 0,
            male: 0.0,
            squares: 0.0,
            log_squares: 0.0,
            relative: Quantiles::new(),
            positive: 0,
            squares_without_floor: 0.0,
        }
    }

    #[inline]
    fn add(&mut self, f: f64, g: f64, cos_i: f64, weight: f64) {
        let error = g - f;
        self.valid += 1;
        self.male += ((1.0 + g * cos_i) / (1.0 + f * cos_i)).ln().abs();
        let relative = error.abs() / f.max(FLOOR);
        self.squares += relative * relative;
        self.relative.add(relative);
        let log = ((g * weight + EPSILON) / (f * weight + EPSILON)).ln();
        self.log_squares += log * log;
        if f > 0.0 {
            self.positive += 1;
            self.squares_without_floor += (error / f).powi(2);
        }
    }

    fn merge(&mut self, other: &Self) {
        self.valid += other.valid;
        self.male += other.male;
        self.squares += other.squares;
        self.log_squares += other.log_squares;
        self.relative.merge(&other.relative);
        self.positive += other.positive;
        self.squares_without_floor += other.squares_without_floor;
    }

    fn metrics(&self, drawn: u64, channels: u64) -> Metrics {
        let n = self.valid as f64;
        let some = |value: f64| (self.valid > 0).then_some(value);
        let positive = self.positive as f64;
        // One definition for both, so that a black estimate scores exactly what black scores.
        let eq4 = |squares: f64| {
            (self.positive > 0).then(|| (squares / positive).sqrt() / (positive / channels as f64).sqrt())
        };
        Metrics {
            male: some(self.male / n),
            median_rel: some(self.relative.quantile(0.5)),
            p95_rel: some(self.relative.quantile(0.95)),
            rel_rms: some((self.squares / n).sqrt()),
            log_rel_rmse: some((self.log_squares / n).sqrt()),
            eq4: eq4(self.squares_without_floor),
            eq4_black: eq4(positive),
            pairs: self.positive / channels,
            left_out: 1.0 - positive / (drawn * channels).max(1) as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use brdf::{Black, Fitted, Lambert};

    fn draw(pairs: u64) -> Draw {
        Draw {
            pairs,
            ..Draw::default()
        }
    }

    #[test]
    fn against_itself_every_error_is_zero() {
        let gold = Fitted::named("gold-paint").unwrap();
        let same = compare(&gold, &[&gold], &draw(10_001))[0];
        for metrics in [same.overall, same.channels.r, same.channels.g, same.channels.b] {
            let zeros = [
                metrics.male,
                metrics.median_rel,
                metrics.p95_rel,
                metrics.rel_rms,
                metrics.log_rel_rmse,
                metrics.eq4,
            ];
            assert_eq!(zeros, [Some(0.0); 6]);
            assert_eq!((metrics.pairs, metrics.left_out), (10_001, 0.0));
        }
    }

    #[test]
    fn black_scores_one_over_root_n() {
        let gold = Fitted::named("gold-paint").unwrap();
        let black = compare(&gold, &[&Black], &draw(90_000))[0];
        assert_eq!(black.overall.eq4, black.overall.eq4_black);
        assert_eq!(black.channels.b.eq4, black.channels.b.eq4_black);
        assert!((black.overall.eq4.unwrap() * 300.0 - 1.0).abs() < 1e-12);
    }

    /// Between two diffusers every metric is a formula.
    #[test]
    fn follows_the_definitions() {
        let (f, g) = (Lambert::new(0.5).unwrap(), Lambert::new(0.6).unwrap());
        let found = compare(&f, &[&g], &draw(40_000))[0].overall;
        for (name, relative) in [
            ("median", found.median_rel),
            ("p95", found.p95_rel),
            ("rms", found.rel_rms),
        ] {
            assert!((relative.unwrap() - 0.2).abs() < 0.0004, "{name} is {relative:?}");
        }
        assert!((found.eq4.unwrap() - 0.2 / 200.0).abs() < 1e-12);
        // Mean over θ_i of ln(1 + g cos θ_i) − ln(1 + f cos θ_i), by the trapezoid rule.
        let (f, g) = (0.5 / std::f64::consts::PI, 0.6 / std::f64::consts::PI);
        let steps = 1000;
        let male = (0..steps)
            .map(|n| {
                (80.0 * (f64::from(n) + 0.5) / f64::from(steps))
                    .to_radians()
                    .cos()
            })
            .map(|cos| ((1.0 + g * cos) / (1.0 + f * cos)).ln())
            .sum::<f64>()
            / f64::from(steps);
        assert!(
            (found.male.unwrap() / male - 1.0).abs() < 0.01,
            "{:?} instead of {male}",
            found.male
        );
    }

    #[test]
    fn a_reference_without_light_has_no_eq4() {
        let found = compare(&Black, &[&Lambert::new(0.5).unwrap()], &draw(1000))[0].overall;
        assert_eq!(
            (found.eq4, found.eq4_black, found.pairs, found.left_out),
            (None, None, 0, 1.0)
        );
        let json = serde_json::to_value(found).unwrap();
        assert!(json["eq4"].is_null() && json["male"].is_f64(), "{json}");
    }

    #[test]
    fn the_keys_are_what_readers_expect() {
        let gold = Fitted::named("gold-paint").unwrap();
        let json = serde_json::to_value(compare(&gold, &[&Black], &draw(100))[0]).unwrap();
        for key in [
            "male",
            "median_rel",
            "p95_rel",
            "rel_rms",
            "log_rel_rmse",
            "eq4",
            "eq4_black",
            "pairs",
            "left_out",
        ] {
            assert!(json[key].is_number(), "{key} in {json}");
            assert!(json["channels"]["g"][key].is_number(), "{key} of green in {json}");
        }
    }
}
