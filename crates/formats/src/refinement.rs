use std::f64::consts::FRAC_PI_2;

use brdf::Brdf;
use glam::DVec3;

use crate::coordinates::{Coordinates, HALF_DIFFERENCE, RECIPROCAL, is_reciprocal, lifted};
use crate::lattice::Lattice;
use crate::{Fidelity, Tolerance};

/// Floor of relative errors, sr⁻¹.
const FLOOR: f64 = 1e-3;

/// A table with nodes where linear interpolation of a BRDF needs them: as few as keep the tolerance, or as many as are
/// allowed.
pub(crate) fn fitted(
    coordinates: Coordinates,
    start: [Vec<f64>; 3],
    brdf: &dyn Brdf,
    tolerance: &Tolerance,
    most: usize,
) -> Lattice {
    let mut refinement = Refinement::new(coordinates, start, brdf);
    let mut target = 0.008;
    loop {
        let full = refinement.refine(target, most);
        let table = Lattice::sample(coordinates, refinement.axes(), brdf);
        if full || tolerance.exceeded(&Fidelity::between(brdf, &table)).is_none() {
            return table;
        }
        target *= 0.6;
    }
}

/// Three axes whose intervals are halved where linear interpolation of a BRDF loses most.
struct Refinement<'a> {
    coordinates: Coordinates,
    brdf: &'a dyn Brdf,
    axes: [Vec<Interval>; 3],
}

/// An interval between two nodes of an axis.
#[derive(Clone, Copy)]
struct Interval {
    low: f64,
    high: f64,
    /// What linear interpolation across it adds to the mean relative error over the axis.
    error: f64,
}

impl<'a> Refinement<'a> {
    /// Probes of the two other angles; as many again near the mirror direction.
    const PROBES: u32 = 64;
    /// Where a node more no longer helps: a ten-thousandth of what any tolerance asks for.
    const LEAST: f64 = 1e-6;

    fn new(coordinates: Coordinates, start: [Vec<f64>; 3], brdf: &'a dyn Brdf) -> Self {
        let mut refinement = Self {
            coordinates,
            brdf,
            axes: Default::default(),
        };
        for (axis, nodes) in start.iter().enumerate() {
            let intervals = nodes.windows(2).map(|w| refinement.interval(axis, w[0], w[1]));
            refinement.axes[axis] = intervals.collect();
        }
        refinement
    }

    /// Halves intervals, the one first that loses most for what another node costs, until no axis loses more than
    /// `target`; returns whether no more nodes are allowed, or none would help.
    fn refine(&mut self, target: f64, most: usize) -> bool {
        loop {
            let counts = self.axes.each_ref().map(|axis| axis.len() + 1);
            let total: usize = counts.iter().product();
            let loss = |axis: usize| self.axes[axis].iter().map(|interval| interval.error).sum::<f64>();
            let open: Vec<usize> = (0..3)
                .filter(|&axis| loss(axis) > target.max(Self::LEAST))
                .collect();
            if open.is_empty() {
                return target < Self::LEAST;
            }
            let worst = open
                .into_iter()
                .filter(|&axis| total + total / counts[axis] <= most)
                .filter_map(|axis| {
                    let errors = self.axes[axis].iter().map(|interval| interval.error).enumerate();
                    let (at, error) = errors.max_by(|a, b| a.1.total_cmp(&b.1))?;
                    Some((error * counts[axis] as f64, axis, at))
                })
                .max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, axis, at)) = worst else { return true };
            let Interval { low, high, .. } = self.axes[axis][at];
            let middle = f64::midpoint(low, high);
            let halves = [(low, middle), (middle, high)].map(|(low, high)| self.interval(axis, low, high));
            self.axes[axis].splice(at..=at, halves);
        }
    }

    /// The nodes of the three axes.
    fn axes(&self) -> [Vec<f64>; 3] {
        self.axes.each_ref().map(|axis| {
            let first = axis.first().map(|interval| interval.low);
            first
                .into_iter()
                .chain(axis.iter().map(|interval| interval.high))
                .collect()
        })
    }

    fn interval(&self, axis: usize, low: f64, high: f64) -> Interval {
        let Coordinates { range, across, .. } = self.coordinates;
        let middle = f64::midpoint(low, high);
        // The additive recurrence of the plastic number in two dimensions.
        let places = |n: u32| {
            [0.754_877_666_246_692_8, 0.569_840_290_998_053_3].map(|step| (0.5 + step * f64::from(n)).fract())
        };
        let even = |n: u32| {
            let mut angles = [middle; 3];
            for (other, place) in [(axis + 1) % 3, (axis + 2) % 3].into_iter().zip(places(n)) {
                let [from, to] = range[other];
                angles[other] = from + place * (to - from);
            }
            angles
        };
        let near = |n: u32| (self.coordinates.near_mirror)(axis, middle, places(n));
        let mean = |probe: &(dyn Fn(u32) -> [f64; 3] + Sync)| {
            let errors: Vec<f64> = (0..Self::PROBES)
                .filter_map(|n| self.loss(axis, low, high, probe(n)))
                .collect();
            errors.iter().sum::<f64>() / f64::from(Self::PROBES)
        };
        let [from, to] = range[axis];
        let share = (high - low) / (to - from);
        // Along the fall of a lobe its middle counts as much as its far tail.
        let lobe_share = match across == Some(axis) {
            true => (high.sqrt() - low.sqrt()) / (to.sqrt() - from.sqrt()),
            false => share,
        };
        Interval {
            low,
            high,
            error: (mean(&even) * share).max(mean(&near) * lobe_share),
        }
    }

    /// Relative error of linear interpolation along one axis half-way between two nodes, at most 1; `None` near or below
    /// the horizon.
    fn loss(&self, axis: usize, low: f64, high: f64, middle: [f64; 3]) -> Option<f64> {
        let at = |angle: f64| {
            let mut angles = middle;
            angles[axis] = angle;
            (self.coordinates.directions)(angles)
        };
        let (incident, exitant) = at(middle[axis]);
        if incident.z < 0.03 || exitant.z < 0.03 {
            return None;
        }
        let value = |(incident, exitant)| lifted(self.brdf, incident, exitant);
        let linear = 0.5 * (value(at(low)) + value(at(high)));
        let truth = value((incident, exitant));
        let relative = (linear - truth).abs() / truth.max(DVec3::splat(FLOOR));
        Some(relative.max_element().min(1.0))
    }
}

/// A table over half and difference angles with nodes where a BRDF needs them, and whether it is folded by reciprocity.
pub(crate) fn half_difference(brdf: &dyn Brdf, tolerance: &Tolerance, most: usize) -> (Lattice, bool) {
    let reciprocal = is_reciprocal(brdf);
    let coordinates = if reciprocal { RECIPROCAL } else { HALF_DIFFERENCE };
    let [_, _, [_, turn]] = coordinates.range;
    // Half angles as dense near 0 as MERL's, so that a lobe is found at all.
    let half = (0..=16).map(|n| (f64::from(n) / 16.0).powi(2) * FRAC_PI_2);
    let start = [half.collect(), even(0.0, FRAC_PI_2, 9), even(0.0, turn, 4)];
    (fitted(coordinates, start, brdf, tolerance, most), reciprocal)
}

/// `n` + 1 angles from `low` to `high` in even steps.
pub(crate) fn even(low: f64, high: f64, n: usize) -> Vec<f64> {
    (0..=n)
        .map(|i| low + (high - low) * i as f64 / n as f64)
        .collect()
}
