use std::f64::consts::TAU;

use brdf::{Brdf, Spherical};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use crate::metric::{Channels, Metrics, Tally};
use crate::{Cell, Scene};

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
///
/// ```
/// use brdf::{Black, Lambert};
/// use pdv::{Draw, compare};
///
/// let (half, darker) = (Lambert::new(0.5)?, Lambert::new(0.4)?);
/// let draw = Draw { pairs: 10_000, ..Draw::default() };
/// let found = compare(&half, &[&darker, &Black], &draw);
/// assert!((found[0].overall.median_rel.unwrap() - 0.2).abs() < 0.001);
/// // Black scores 1/√N in the paper's Eq. 4, whatever the reference.
/// assert!((found[1].overall.eq4.unwrap() - 0.01).abs() < 1e-12);
/// # Ok::<(), brdf::Error>(())
/// ```
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
    let streams: Vec<Vec<[Tally; 3]>> = (0..STREAMS)
        .into_par_iter()
        .map(|stream| {
            let mut rng = ChaCha8Rng::seed_from_u64(draw.seed);
            rng.set_stream(stream);
            let share = draw.pairs / STREAMS + u64::from(stream < draw.pairs % STREAMS);
            let mut sums: Vec<[Tally; 3]> =
                estimates.iter().map(|_| [(); 3].map(|()| Tally::new())).collect();
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
            let mut channels = [(); 3].map(|()| Tally::new());
            for stream in &streams {
                channels
                    .iter_mut()
                    .zip(&stream[n])
                    .for_each(|(sum, part)| sum.merge(part));
            }
            let (overall, channels) = Tally::of_channels(&channels, draw.pairs);
            Comparison {
                overall,
                channels,
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
    sums: &mut [[Tally; 3]],
) {
    if !reference.valid(incident, exitant) {
        return;
    }
    let f = reference.eval(incident, exitant).to_array();
    for (estimate, sums) in estimates.iter().zip(sums) {
        if estimate.valid(incident, exitant) {
            let g = estimate.eval(incident, exitant).to_array();
            for (sums, (f, g)) in sums.iter_mut().zip(f.into_iter().zip(g)) {
                sums.add(f, g, incident.z, exitant.z);
            }
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
