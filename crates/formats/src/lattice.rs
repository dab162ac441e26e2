use brdf::Brdf;
use glam::DVec3;
use rayon::prelude::*;

use crate::coordinates::{Coordinates, lifted};
use crate::{Error, Place};

/// Two nodes of one axis that are nearer than this, rad, are one.
const SAME_RAD: f64 = 1e-6;
/// How many combinations there may be for each node of a table with gaps: about half of the directions about a mirror
/// direction lie below the horizon.
const MOST_GAPS: usize = 8;

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
