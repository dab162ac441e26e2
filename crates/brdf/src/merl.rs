use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use rayon::prelude::*;

use crate::{Brdf, HalfDifference};

/// A BRDF tabulated over half and difference angles as the MERL database does (Matusik et al. 2003).
///
/// 90 × 90 × 180 nodes: θ_h = (i/90)²·90°, θ_d = j°, φ_d = k° (φ_d + 180° is the same by reciprocity), RGB in sr⁻¹.
/// A negative entry is invalid. Between nodes it interpolates linearly in the three angles; invalid neighbours are
/// left out and the weights of the others made to sum to 1, per channel; where no neighbour is valid it is 0. Beyond
/// the last node it is held constant.
#[derive(Clone, Debug, PartialEq)]
pub struct MerlTable {
    /// φ_d fastest, θ_h slowest.
    nodes: Vec<[f64; 3]>,
}

impl MerlTable {
    /// Numbers of θ_h, θ_d and φ_d nodes.
    pub const SHAPE: [usize; 3] = [90, 90, 180];
    /// Number of nodes.
    pub const NODES: usize = Self::SHAPE[0] * Self::SHAPE[1] * Self::SHAPE[2];

    /// The table whose nodes, φ_d fastest and θ_h slowest, are given in sr⁻¹.
    pub(crate) fn from_nodes(nodes: Vec<[f64; 3]>) -> Self {
        debug_assert_eq!(nodes.len(), Self::NODES);
        Self { nodes }
    }

    /// Tabulates a BRDF at every node, on all cores; −1 where either direction is at or below the horizon.
    ///
    /// ```
    /// use brdf::{Brdf, Lambert, MerlTable};
    /// use glam::DVec3;
    ///
    /// let table = MerlTable::fill(&Lambert::new(0.5)?);
    /// let f = table.eval(DVec3::new(0.6, 0.0, 0.8), DVec3::Z);
    /// assert!((f.x - 0.5 / std::f64::consts::PI).abs() < 1e-15);
    /// // The last node of θ_h and θ_d lies below the horizon.
    /// assert_eq!(table.node([89, 89, 0]).x, -1.0);
    /// # Ok::<(), brdf::Error>(())
    /// ```
    pub fn fill(brdf: &(impl Brdf + ?Sized)) -> Self {
        let [_, rows, columns] = Self::SHAPE;
        let mut nodes = vec![[0.0; 3]; Self::NODES];
        nodes
            .par_chunks_mut(columns)
            .enumerate()
            .for_each(|(line, nodes)| {
                for (k, node) in nodes.iter_mut().enumerate() {
                    let (incident, exitant) = Self::coordinates([line / rows, line % rows, k]).directions();
                    *node = if incident.z > 0.0 && exitant.z > 0.0 {
                        brdf.eval(incident, exitant).to_array()
                    } else {
                        [-1.0; 3]
                    };
                }
            });
        Self { nodes }
    }

    /// The angles of a node by its indices of θ_h, θ_d, φ_d.
    ///
    /// ```
    /// use brdf::MerlTable;
    ///
    /// let node = MerlTable::coordinates([9, 45, 90]);
    /// assert!((node.theta_h.to_degrees() - 0.9).abs() < 1e-12, "90° times the square of a tenth");
    /// assert!((node.theta_d.to_degrees() - 45.0).abs() < 1e-12);
    /// assert!((node.phi_d.to_degrees() - 90.0).abs() < 1e-12);
    /// ```
    pub fn coordinates(index: [usize; 3]) -> HalfDifference {
        let [i, j, k] = index.map(|n| n as f64);
        HalfDifference {
            theta_h: (i / 90.0).powi(2) * FRAC_PI_2,
            theta_d: j.to_radians(),
            phi_d: k.to_radians(),
        }
    }

    /// The entry of a node in sr⁻¹; negative where it is invalid.
    ///
    /// # Panics
    /// An index is beyond [`MerlTable::SHAPE`].
    pub fn node(&self, index: [usize; 3]) -> DVec3 {
        let [i, j, k] = index;
        let [_, rows, columns] = Self::SHAPE;
        DVec3::from_array(self.nodes[k + columns * (j + rows * i)])
    }

    /// All entries in sr⁻¹, φ_d fastest and θ_h slowest; negative where invalid.
    pub fn nodes(&self) -> &[[f64; 3]] {
        &self.nodes
    }

    /// Weighted sum of the valid neighbours and the weight that they have, per channel.
    fn gather(&self, incident: DVec3, exitant: DVec3) -> (DVec3, DVec3) {
        let angles = HalfDifference::from_directions(incident, exitant);
        let [_, rows, columns] = Self::SHAPE;
        let (i, u) = theta_h_cell(angles.theta_h);
        let (j, v) = cell(angles.theta_d.to_degrees(), rows);
        let phi = angles.phi_d.rem_euclid(PI).to_degrees();
        let k = (phi as usize).min(columns - 1);
        let w = (phi - k as f64).min(1.0);
        let (mut sum, mut weight) = (DVec3::ZERO, DVec3::ZERO);
        for (i, u) in [(i, 1.0 - u), (i + 1, u)] {
            for (j, v) in [(j, 1.0 - v), (j + 1, v)] {
                for (k, w) in [(k, 1.0 - w), ((k + 1) % columns, w)] {
                    let part = u * v * w;
                    let value = self.node([i, j, k]);
                    let valid = DVec3::select(value.cmpge(DVec3::ZERO), DVec3::splat(part), DVec3::ZERO);
                    sum += valid * value;
                    weight += valid;
                }
            }
        }
        (sum, weight)
    }
}

/// The interval of θ_h nodes around an angle and the place in it, 0 … 1, linear in θ_h.
fn theta_h_cell(theta_h: f64) -> (usize, f64) {
    let last = MerlTable::SHAPE[0] - 1;
    // θ_h in units of the first interval: node i lies at i².
    let t = theta_h / FRAC_PI_2 * 8100.0;
    let i = (t.max(0.0).sqrt() as usize).min(last - 1);
    let below = (i * i) as f64;
    (i, ((t - below) / (2 * i + 1) as f64).clamp(0.0, 1.0))
}

/// The interval of unit-spaced nodes around `at` and the place in it; held beyond the last node.
fn cell(at: f64, nodes: usize) -> (usize, f64) {
    let i = (at as usize).min(nodes - 2);
    (i, (at - i as f64).clamp(0.0, 1.0))
}

impl Brdf for MerlTable {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return DVec3::ZERO;
        }
        let (sum, weight) = self.gather(incident, exitant);
        DVec3::select(
            weight.cmpgt(DVec3::ZERO),
            sum / weight.max(DVec3::splat(f64::MIN_POSITIVE)),
            DVec3::ZERO,
        )
    }

    fn valid(&self, incident: DVec3, exitant: DVec3) -> bool {
        incident.z > 0.0 && exitant.z > 0.0 && self.gather(incident, exitant).1.min_element() > 0.0
    }
}
