use std::f64::consts::FRAC_PI_2;

use brdf::Brdf;
use glam::DVec3;
use rayon::prelude::*;

use crate::coordinates::{Coordinates, HALF_DIFFERENCE, RECIPROCAL, is_reciprocal, lifted};
use crate::{Error, Fidelity, Place, Tolerance};

/// Two nodes of one axis that are nearer than this, rad, are one.
const SAME_RAD: f64 = 1e-6;
/// How many combinations there may be for each node of a table with gaps: about half of the directions about a mirror
/// direction lie below the horizon.
const MOST_GAPS: usize = 8;
/// Floor of relative errors, sr⁻¹.
const FLOOR: f64 = 1e-3;

/// A BRDF tabulated over every combination of three lists of angles, linear between them and held beyond them.
pub(crate) struct Lattice {
    /// The angles of incident and exitant direction.
    of: fn(DVec3, DVec3) -> [f64; 3],
    /// Ascending, rad.
    axes: [Vec<f64>; 3],
    /// The last axis fastest, sr⁻¹.
    values: Vec<DVec3>,
}

impl Lattice {
    /// Samples a BRDF at the nodes of three axes; what lies below the horizon takes the value at the horizon.
    pub(crate) fn sample(coordinates: Coordinates, axes: [Vec<f64>; 3], brdf: &dyn Brdf) -> Self {
        let [a, b, c] = &axes;
        let nodes = a.par_iter().flat_map_iter(|&a| {
            let rest = b.iter().flat_map(move |&b| c.iter().map(move |&c| [a, b, c]));
            rest.map(|angles| {
                let (incident, exitant) = (coordinates.directions)(angles);
                lifted(brdf, incident, exitant)
            })
        });
        let values = nodes.collect();
        Self {
            of: coordinates.of,
            axes,
            values,
        }
    }

    /// A table from its values, the last axis fastest; `of` gives the place of incident and exitant direction.
    pub(crate) fn new(of: fn(DVec3, DVec3) -> [f64; 3], axes: [Vec<f64>; 3], values: Vec<DVec3>) -> Self {
        debug_assert_eq!(values.len(), axes.iter().map(Vec::len).product::<usize>());
        Self { of, axes, values }
    }

    /// A table from nodes in any order, over all combinations of the angles that occur; a node that occurs more than once
    /// has the mean. With `gaps`, combinations that are missing, as those below the horizon, take the value of the nearest
    /// node: along the first of these axes, else the second, else the third.
    ///
    /// # Errors
    /// There is no node, or too few for their combinations; without `gaps`, a combination is missing.
    pub(crate) fn from_nodes(
        coordinates: Coordinates,
        names: [&str; 3],
        nodes: &[([f64; 3], DVec3)],
        gaps: Option<[usize; 3]>,
    ) -> Result<Self, Error> {
        let axes: [Vec<f64>; 3] = std::array::from_fn(|axis| {
            let mut angles: Vec<f64> = nodes.iter().map(|(node, _)| node[axis]).collect();
            angles.sort_unstable_by(f64::total_cmp);
            angles.dedup_by(|b, a| *b - *a < SAME_RAD);
            angles
        });
        let [a, b, c] = axes.each_ref().map(Vec::len);
        let whole = a.checked_mul(b).and_then(|ab| ab.checked_mul(c));
        let found = || {
            let [x, y, z] = names;
            format!(
                "{} nodes over {a} angles {x}, {b} angles {y} and {c} angles {z}",
                nodes.len()
            )
        };
        let allowed = "one node for every combination of the angles";
        // What has too few nodes for its combinations is refused, however large the product.
        let most = nodes
            .len()
            .saturating_mul(if gaps.is_some() { MOST_GAPS } else { 1 });
        let Some(count) = whole.filter(|&count| count > 0 && count <= most) else {
            return Err(Error::malformed(Place::Field("nodes".into()), found(), allowed));
        };
        let mut sums = vec![(DVec3::ZERO, 0.0); count];
        for (node, value) in nodes {
            let index: [usize; 3] = std::array::from_fn(|axis| {
                axes[axis]
                    .partition_point(|&angle| angle < node[axis] - SAME_RAD)
                    .min(axes[axis].len() - 1)
            });
            let slot = &mut sums[(index[0] * b + index[1]) * c + index[2]];
            slot.0 += *value;
            slot.1 += 1.0;
        }
        let missing = sums.iter().position(|(_, count)| *count == 0.0);
        if let (Some(missing), None) = (missing, gaps) {
            let at = [missing / (b * c), missing / c % b, missing % c];
            let angles: [String; 3] = std::array::from_fn(|axis| {
                format!("{} {:.3}°", names[axis], axes[axis][at[axis]].to_degrees())
            });
            let found = format!("{}; the one at {} is missing", found(), angles.join(", "));
            return Err(Error::malformed(Place::Field("nodes".into()), found, allowed));
        }
        let mut values: Vec<DVec3> = sums.into_iter().map(|(sum, count)| sum / count).collect();
        if missing.is_some() {
            for axis in gaps.into_iter().flatten() {
                close(&mut values, [a, b, c], axis);
            }
        }
        Ok(Self {
            of: coordinates.of,
            axes,
            values,
        })
    }

    /// The three lists of angles, ascending, rad.
    pub(crate) fn axes(&self) -> &[Vec<f64>; 3] {
        &self.axes
    }

    /// The value of a node, sr⁻¹.
    pub(crate) fn node(&self, [a, b, c]: [usize; 3]) -> DVec3 {
        self.values[(a * self.axes[1].len() + b) * self.axes[2].len() + c]
    }

    /// Angles and value of every node, the last axis fastest.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = ([f64; 3], DVec3)> {
        let [a, b, c] = &self.axes;
        let angles = a
            .iter()
            .flat_map(move |&a| b.iter().flat_map(move |&b| c.iter().map(move |&c| [a, b, c])));
        angles.zip(self.values.iter().copied())
    }

    fn at(&self, angles: [f64; 3]) -> DVec3 {
        let cells: [(usize, f64); 3] = std::array::from_fn(|axis| cell(&self.axes[axis], angles[axis]));
        let mut sum = DVec3::ZERO;
        for corner in 0..8_usize {
            let mut weight = 1.0;
            let index = std::array::from_fn(|axis| {
                let (at, part) = cells[axis];
                let upper = corner >> axis & 1;
                weight *= if upper == 1 { part } else { 1.0 - part };
                (at + upper).min(self.axes[axis].len() - 1)
            });
            if weight > 0.0 {
                sum += weight * self.node(index);
            }
        }
        sum
    }
}

impl Brdf for Lattice {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return DVec3::ZERO;
        }
        self.at((self.of)(incident, exitant))
    }
}

/// Gives every value that is not a number the nearest one along an axis, where there is one.
fn close(values: &mut [DVec3], counts: [usize; 3], axis: usize) {
    let strides = [counts[1] * counts[2], counts[2], 1];
    let (length, stride) = (counts[axis], strides[axis]);
    for start in (0..values.len()).filter(|at| at / stride % length == 0) {
        let known: Vec<usize> = (0..length)
            .filter(|n| !values[start + n * stride].is_nan())
            .collect();
        if known.is_empty() || known.len() == length {
            continue;
        }
        for n in 0..length {
            let above = known.partition_point(|&known| known < n);
            let near = [above.checked_sub(1), Some(above)]
                .into_iter()
                .flatten()
                .filter_map(|at| known.get(at));
            if let Some(&nearest) = near.min_by_key(|known| known.abs_diff(n)) {
                values[start + n * stride] = values[start + nearest * stride];
            }
        }
    }
}

/// The interval of an axis around a place and the share of it that lies below; held beyond the ends.
pub(crate) fn cell(axis: &[f64], at: f64) -> (usize, f64) {
    if axis.len() < 2 {
        return (0, 0.0);
    }
    let above = axis.partition_point(|&node| node <= at);
    let index = above.clamp(1, axis.len() - 1) - 1;
    let width = axis[index + 1] - axis[index];
    (index, ((at - axis[index]) / width).clamp(0.0, 1.0))
}

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
