use pdv::{Distribution, Draw, Separable};

use crate::{Error, Material};

/// A checked evaluation.
#[derive(Clone)]
pub struct Evaluation {
    /// What is reconstructed.
    pub materials: Vec<Material>,
    /// θ_r^dp of the planes, rad; one reconstruction for each.
    pub theta_r: Vec<f64>,
    /// How each plane is read.
    pub plane: Plane,
    /// How the arc is read.
    pub arc: VirtualArc,
    /// Pairs on which the reconstructions are judged.
    pub draw: Draw,
    /// What is shown as a lit sphere.
    pub spheres: Vec<Material>,
    /// θ_r^dp of the reconstructions that are shown, rad; one of `theta_r`.
    pub shown: f64,
}

/// A plane that is read on the side towards the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Values of d_p, the mirror direction among them.
    pub readings: usize,
    /// How they are distributed.
    pub distribution: Distribution,
    /// Largest zenith angle of the light on the far side, rad.
    pub light_max: f64,
}

/// The mirror arc from the normal outwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualArc {
    /// Values of θ_r, evenly.
    pub readings: usize,
    /// The largest of them, rad.
    pub theta_max: f64,
}

impl Plane {
    /// Deviations from the mirror direction, ascending from 0.
    pub fn deviations(&self, theta_r: f64) -> Vec<f64> {
        let reachable = 0.0..=theta_r.sin() + self.light_max.sin();
        pdv::spread(self.distribution, theta_r, &[reachable], self.readings, 0.0).deviations
    }
}

impl VirtualArc {
    /// θ_r in rad, ascending from 0.
    pub fn thetas(&self) -> Vec<f64> {
        let intervals = self.readings.max(2) - 1;
        (0..self.readings)
            .map(|n| self.theta_max * n as f64 / intervals as f64)
            .collect()
    }
}

impl Evaluation {
    /// One reconstruction of a material for each θ_r^dp.
    ///
    /// # Errors
    /// No pose of a plane or of the arc exists.
    pub fn reconstruct(&self, material: &Material) -> Result<Vec<Separable>, Error> {
        let arc = self.arc.thetas();
        let model = |&theta_r: &f64| {
            Separable::sample(
                &material.brdf,
                theta_r,
                &self.plane.deviations(theta_r),
                &arc,
                0.0,
            )
            .map_err(|source| Error::Model {
                material: material.name.clone(),
                theta_r_deg: theta_r.to_degrees(),
                source,
            })
        };
        self.theta_r.iter().map(model).collect()
    }
}
