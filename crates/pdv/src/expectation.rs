use std::f64::consts::{FRAC_PI_2, PI};

use brdf::Spherical;
use glam::DVec3;

use crate::bisected::Pair;
use crate::surface::Surface;
use crate::sweeps::Sweeps;
use crate::table::{STEPS, THETA_MAX};
use crate::{Error, Observation, Scene, Shape};

/// Pairs of directions over which changes are averaged: their mean is known to a few per cent.
const PAIRS: usize = 1024;
/// Changes below this are none: what is left of rounding and of black specimens.
const LEAST: f64 = 1e-6;

/// How wrong a [`crate::Planes`] of the readings so far is expected to be, and what more readings would change.
///
/// Everything is learnt from the readings: the model is made again without some of them, always with the shape that all
/// of them chose, and what changes over the pairs of the scene is looked at, as mean |Δ ln(1 + f cos θ_i)|.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// Expected MALE over the pairs of the scene below 80°.
    pub male: f64,
    /// What that follows from.
    pub signs: Signs,
    /// By how much each reading more could lower the error.
    pub worth: Worth,
}

/// What is told of the error by the readings alone, each a mean |Δ ln(1 + f cos θ_i)|.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signs {
    /// Between two ways to carry the readings out of the plane: by half angle and product of cosines, and by half and
    /// difference angle. No reading in the plane lowers it.
    pub form: f64,
    /// What a plane less changes, in the mean over the planes; of a single plane, what a side less changes.
    pub planes: f64,
    /// What half of the readings of all planes changes.
    pub readings: f64,
    /// What half of the readings of the arc changes.
    pub arc: f64,
    /// How badly each side of each plane is predicted by the others, in the plane.
    pub sides: f64,
    /// Mean ln(1 + f cos θ_i) itself.
    pub level: f64,
}

/// By how much more readings are expected to lower the error.
#[derive(Clone, Debug, PartialEq)]
pub struct Worth {
    /// A plane in each gap between the planes and at their ends: θ_r in rad, up to 80°, and the gain.
    pub planes: Vec<(f64, f64)>,
    /// Twice the readings of each plane, in the order of the planes.
    pub readings: Vec<f64>,
    /// Twice the readings of the arc.
    pub arc: f64,
}

impl Expectation {
    /// What is expected of readings; `scene` says where, everywhere below 80° if not given.
    ///
    /// # Errors
    /// As [`crate::Planes::from_observations`].
    ///
    /// ```
    /// # use pdv::Observation;
    /// # let gold = brdf::Fitted::named("gold-paint").expect("one of the fitted materials");
    /// # let plane = |theta_r: f64| -> Vec<Observation> {
    /// #     let deviations = [-0.04, 0.0, 0.02, 0.06, 0.15, 0.4, 0.8];
    /// #     deviations.iter().filter_map(|&d| Observation::of(&gold, theta_r, d)).collect()
    /// # };
    /// # let arc: Vec<_> = [0.1, 0.5, 0.9, 1.3].iter().filter_map(|&t| Observation::of(&gold, t, 0.0)).collect();
    ///
    /// use pdv::Expectation;
    ///
    /// let few = Expectation::new(&[plane(0.3), plane(1.0)], &arc, None)?;
    /// assert!(few.male > 0.0 && few.male < 0.1);
    /// // A plane below, between and above the two.
    /// assert_eq!(few.worth.planes.len(), 3);
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn new(
        planes: &[Vec<Observation>],
        arc: &[Observation],
        scene: Option<&Scene>,
    ) -> Result<Self, Error> {
        let sweeps = Sweeps::new(planes, arc)?;
        let (surface, sides) = crate::choice::choose(&sweeps)?;
        let over = Over::new(scene);
        let whole = over.logs(&surface, Surface::reflectance);
        let form = over.change(
            &whole,
            &over.logs(&surface, |surface, pair| surface.at(pair.bisected(), None)),
        );
        let shape = surface.excess.shape;
        let without =
            |planes: &[Vec<Observation>], arc: &[Observation]| over.without(&whole, shape, planes, arc);
        let apart: Vec<f64> = (0..planes.len())
            .map(|n| less_one(planes, n, |rest| without(rest, arc)))
            .collect();
        let halves: Vec<f64> = (0..planes.len())
            .map(|n| {
                let mut rest = planes.to_vec();
                rest[n] = every_other(&rest[n], |o| o.deviation);
                without(&rest, arc)
            })
            .collect();
        let along = every_other(arc, |o| o.theta_r);
        let signs = Signs {
            form,
            planes: apart.iter().sum::<f64>() / apart.len() as f64,
            readings: halves.iter().sum(),
            arc: without(planes, &along),
            sides: sides.unwrap_or(form),
            level: over.over_all(whole.iter().copied()),
        };
        // A plane that is left out takes the error of its own readings with it, which no other plane would lower.
        let between: Vec<f64> = apart
            .iter()
            .zip(&halves)
            .map(|(apart, half)| (apart - half).max(0.0))
            .collect();
        Ok(Self {
            male: signs.male(planes.iter().filter(|plane| !plane.is_empty()).count()),
            worth: Worth {
                planes: gaps(planes, &between),
                // What halving changes is four times of what doubling does, where the error goes with the square of
                // the distance between readings.
                readings: halves.iter().map(|half| half / 4.0).collect(),
                arc: signs.arc / 4.0,
            },
            signs,
        })
    }
}

impl Signs {
    /// MALE by a fit over half of the fitted materials; `cargo run --release -p study --example expected` makes it,
    /// and tries it on the other half.
    fn male(&self, planes: usize) -> f64 {
        let terms = self.terms(planes);
        terms
            .iter()
            .zip(WEIGHTS)
            .map(|(term, weight)| term * weight)
            .sum::<f64>()
            .exp()
    }

    /// What ln MALE is fitted to be linear in, for so many planes.
    pub fn terms(&self, planes: usize) -> [f64; 8] {
        let log = |value: f64| (value + LEAST).ln();
        [
            1.0,
            log(self.form),
            log(self.planes),
            log(self.readings),
            log(self.arc),
            log(self.sides),
            log(self.level),
            (planes.max(1) as f64).ln(),
        ]
    }
}

/// Weights of [`Signs::terms`].
const WEIGHTS: [f64; 8] = [-1.5996, 0.2088, 0.1022, 0.1951, 0.0320, 0.2479, 0.0444, -0.3369];

/// Pairs of the scene, each with its share of all that is looked at, and the channels that count.
struct Over {
    pairs: Vec<(f64, DVec3, Pair)>,
    channels: DVec3,
}

impl Over {
    fn new(scene: Option<&Scene>) -> Self {
        let cells = scene.unwrap_or(&Scene::whole()).below(THETA_MAX);
        let channels = scene.map_or([true; 3], |scene| scene.channels);
        let weights = DVec3::from_array(channels.map(|wanted| f64::from(u8::from(wanted))));
        let all: f64 = cells.iter().map(|cell| cell.weight).sum();
        let mut next = 0;
        let pairs = cells.iter().flat_map(|cell| {
            let share = cell.weight / all;
            let count = (PAIRS as f64 * share).ceil() as usize;
            let first = next;
            next += count;
            (first..next).map(move |n| {
                let [u, v, w] = STEPS.map(|step| (0.5 + step * n as f64).fract());
                let within = |[low, high]: [f64; 2], share: f64| low + (high - low) * share;
                let incident = Spherical {
                    theta: within(cell.theta_i, u),
                    phi: PI * w,
                };
                let exitant = Spherical {
                    theta: within(cell.theta_o, v),
                    phi: 0.0,
                };
                let (incident, exitant) = (incident.direction(), exitant.direction());
                (share / count as f64, incident, Pair::new(incident, exitant))
            })
        });
        Self {
            pairs: pairs.collect(),
            channels: weights / weights.element_sum(),
        }
    }

    /// ln(1 + f cos θ_i) at every pair.
    fn logs(&self, surface: &Surface, at: impl Fn(&Surface, &Pair) -> DVec3) -> Vec<DVec3> {
        let log = |(_, incident, pair): &(f64, DVec3, Pair)| (at(surface, pair) * incident.z).map(f64::ln_1p);
        self.pairs.iter().map(log).collect()
    }

    fn mean(&self, rgb: DVec3) -> f64 {
        rgb.dot(self.channels)
    }

    /// Mean over the pairs of what is given for each, and over the channels.
    fn over_all(&self, values: impl Iterator<Item = DVec3>) -> f64 {
        let weighted = self.pairs.iter().zip(values);
        weighted
            .map(|((share, ..), value)| share * self.mean(value))
            .sum()
    }

    fn change(&self, before: &[DVec3], after: &[DVec3]) -> f64 {
        let changes = before.iter().zip(after).map(|(a, b)| (*a - *b).abs());
        self.over_all(changes)
    }

    /// What changes where only some of the readings are there; 0 where nothing can be made of them.
    fn without(
        &self,
        whole: &[DVec3],
        shape: Shape,
        planes: &[Vec<Observation>],
        arc: &[Observation],
    ) -> f64 {
        let surface = Sweeps::new(planes, arc).and_then(|sweeps| Surface::new(&sweeps, shape));
        surface.map_or(0.0, |surface| {
            self.change(whole, &self.logs(&surface, Surface::reflectance))
        })
    }
}

/// What a plane less changes; of a single one, the larger of what its sides do.
fn less_one(planes: &[Vec<Observation>], n: usize, change: impl Fn(&[Vec<Observation>]) -> f64) -> f64 {
    let mut rest = planes.to_vec();
    let others = rest
        .iter()
        .enumerate()
        .any(|(k, plane)| k != n && !plane.is_empty());
    if others {
        rest[n].clear();
        return change(&rest);
    }
    let side = |sign: f64| {
        let mut rest = planes.to_vec();
        rest[n].retain(|o| o.deviation * sign >= 0.0);
        change(&rest)
    };
    side(1.0).max(side(-1.0))
}

/// Every second reading in the order of a coordinate, the first and the last among them.
fn every_other(readings: &[Observation], of: impl Fn(&Observation) -> f64) -> Vec<Observation> {
    let mut sorted = readings.to_vec();
    sorted.sort_by(|a, b| of(a).total_cmp(&of(b)));
    let last = sorted.len().saturating_sub(1);
    let kept = sorted
        .iter()
        .enumerate()
        .filter(|(n, _)| n % 2 == 0 || *n == last);
    kept.map(|(_, o)| *o).collect()
}

/// For a plane in the middle of every gap its θ_r and what it is worth, when leaving a plane out changes so much between
/// the planes. Beyond the last plane it stands at 80° at most, where what is looked at ends.
///
/// A gap twice as wide has four times the error; leaving a plane out widens its own to the sum of both beside it.
fn gaps(planes: &[Vec<Observation>], between: &[f64]) -> Vec<(f64, f64)> {
    let mut known: Vec<(f64, f64)> = planes
        .iter()
        .zip(between)
        .filter_map(|(plane, &change)| {
            let theta_r = plane.iter().map(|o| o.theta_r).sum::<f64>() / plane.len() as f64;
            (!plane.is_empty()).then_some((theta_r, change))
        })
        .collect();
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A plane on one side of the normal says the same of the other.
    let ends = [-known[0].0, FRAC_PI_2];
    let at = |n: isize| match usize::try_from(n) {
        Ok(n) if n < known.len() => known[n].0,
        Ok(_) => ends[1],
        Err(_) => ends[0],
    };
    let bend = |n: isize| {
        let change = known[usize::try_from(n).unwrap_or(0).min(known.len() - 1)].1;
        let n = n.clamp(0, known.len() as isize - 1);
        change / (at(n + 1) - at(n - 1)).powi(2).max(1e-6)
    };
    (-1..known.len() as isize)
        .map(|n| {
            let (low, high) = (at(n).max(0.0), at(n + 1));
            let gain = 0.5 * (bend(n) + bend(n + 1)) * (high - low).powi(2);
            ((0.5 * (low + high)).min(THETA_MAX), gain)
        })
        .collect()
}
