use std::f64::consts::FRAC_PI_2;

use pdv::{Distribution, Draw, Separable};

use crate::{Error, Material};

/// A checked evaluation.
#[derive(Clone)]
pub struct Evaluation {
    /// What is reconstructed.
    pub materials: Vec<Material>,
    /// θ_r^dp of the planes, rad; one reconstruction for each.
    pub theta_r: Vec<f64>,
    /// Where the materials are read.
    pub nodes: Nodes,
    /// Pairs on which the reconstructions are judged.
    pub draw: Draw,
    /// What is shown as a lit sphere.
    pub spheres: Vec<Material>,
    /// θ_r^dp of the reconstructions that are shown, rad; one of `theta_r`.
    pub shown: f64,
}

/// The grid in PDV that every material is converted to (section 5 of the paper: 90 × 90 × 360 for θ_r, d_p and φ_p).
///
/// The value of a node is the BRDF at the node, and a plane and an arc read but two lines of it, at φ_p = 0; so nodes
/// are evaluated where they are read, and no grid is stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nodes {
    /// Nodes of θ_r, evenly from the normal to below 90°.
    pub theta_r: usize,
    /// Nodes of d_p from 0 to 2, the same for every θ_r.
    pub d_p: usize,
    /// How those of d_p are distributed.
    pub distribution: Distribution,
}

impl Nodes {
    /// θ_r in rad, ascending from 0: what the arc reads.
    pub fn thetas(&self) -> impl Iterator<Item = f64> {
        let step = FRAC_PI_2 / self.theta_r as f64;
        (0..self.theta_r).map(move |n| step * n as f64)
    }

    /// All d_p, ascending from 0; at some θ_r those beyond 1 + sin θ_r do not exist.
    pub fn deviations(&self) -> Vec<f64> {
        // The whole range is reached from the horizon.
        pdv::spread(self.distribution, FRAC_PI_2, &[0.0..=2.0], self.d_p, 0.0).deviations
    }
}

impl Evaluation {
    /// One reconstruction of a material for each θ_r^dp.
    ///
    /// # Errors
    /// No pose of a plane or of the arc exists.
    pub fn reconstruct(&self, material: &Material) -> Result<Vec<Separable>, Error> {
        let (arc, deviations): (Vec<f64>, _) = (self.nodes.thetas().collect(), self.nodes.deviations());
        let model = |&theta_r: &f64| {
            let model = Separable::sample(&material.brdf, theta_r, &deviations, &arc, 0.0);
            model.map_err(|source| Error::Model {
                material: material.name.clone(),
                theta_r_deg: theta_r.to_degrees(),
                source,
            })
        };
        self.theta_r.iter().map(model).collect()
    }
}
