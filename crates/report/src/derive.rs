use std::sync::Arc;

use brdf::Brdf;
use pdv::{Auto, Bivariate, Model, Observation, Planes, Separable, Within};
use rig::{Port, RigFile};
use sweep::{Job, Sweep};

use crate::{Measurement, observations};

/// The observations that a model is made of.
pub struct Sweeps {
    /// Of each plane and then of each leg of the job, in its order.
    pub planes: Vec<Vec<Observation>>,
    /// Of the arc; empty where the job has none.
    pub arc: Vec<Observation>,
}

impl Sweeps {
    /// Sorts measurements by sweep.
    pub fn new(job: &Job, measurements: &[Measurement]) -> Self {
        Self {
            planes: job
                .curves()
                .map(|curve| observations(measurements, curve))
                .collect(),
            arc: observations(measurements, Sweep::Arc),
        }
    }

    /// The model that the job asks for, within its scene.
    ///
    /// # Errors
    /// Too few usable readings.
    pub fn model(&self, job: &Job) -> Result<Box<dyn Model>, pdv::Error> {
        let model = model(job.model, &self.planes, &self.arc)?;
        Ok(match &job.scene {
            Some(scene) => Box::new(Within::new(model, scene.clone())),
            None => model,
        })
    }
}

/// The model of a kind from the observations of planes and arc; one of a single plane is made of the first.
///
/// # Errors
/// Too few usable readings.
pub fn model(
    kind: sweep::Model,
    planes: &[Vec<Observation>],
    arc: &[Observation],
) -> Result<Box<dyn Model>, pdv::Error> {
    let first = &planes[..planes.len().min(1)];
    Ok(match kind {
        sweep::Model::Separable => {
            let plane = first.first().map(Vec::as_slice).unwrap_or_default();
            Box::new(Separable::from_observations(plane, arc)?)
        }
        sweep::Model::Reciprocal => Box::new(Planes::from_observations(first, arc)?),
        sweep::Model::Planes => Box::new(Planes::from_observations(planes, arc)?),
        sweep::Model::Bivariate => Box::new(Bivariate::from_observations(planes, arc)?),
        sweep::Model::Auto => Box::new(Auto::from_observations(planes, arc)?),
    })
}

/// What lay on the simulated stage, where the built-in simulator was used and its specimen can still be had.
pub(crate) fn truth(rig: &RigFile) -> Option<Arc<dyn Brdf>> {
    if rig.bus.port != Port::Sim {
        return None;
    }
    let specimen = rig.sim.get("specimen")?.as_str()?;
    brdf::specimen(specimen)
        .inspect_err(|error| tracing::warn!("no errors against the truth: {error}"))
        .ok()
}
