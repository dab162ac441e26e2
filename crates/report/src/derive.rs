use std::sync::Arc;

use brdf::Brdf;
use pdv::{Model, Observation, Planes, Separable};
use rig::{Port, RigFile};
use sweep::{Job, Sweep};

use crate::{Measurement, observations};

/// The observations that a model is made of.
pub(crate) struct Sweeps {
    /// Of each plane of the job, in its order.
    pub(crate) planes: Vec<Vec<Observation>>,
    /// Of the arc; empty where the job has none.
    pub(crate) arc: Vec<Observation>,
}

impl Sweeps {
    /// Sorts measurements by sweep.
    pub(crate) fn new(job: &Job, measurements: &[Measurement]) -> Self {
        let planes = 0..job.planes.len();
        Self {
            planes: planes
                .map(|i| observations(measurements, Sweep::Plane(i)))
                .collect(),
            arc: observations(measurements, Sweep::Arc),
        }
    }

    /// The model that the job asks for: all but "planes" are made of the first plane and the arc.
    ///
    /// # Errors
    /// Too few usable readings.
    pub(crate) fn model(&self, job: &Job) -> Result<Box<dyn Model>, pdv::Error> {
        let first = &self.planes[..self.planes.len().min(1)];
        Ok(match job.model {
            sweep::Model::Separable => {
                let plane = first.first().map(Vec::as_slice).unwrap_or_default();
                Box::new(Separable::from_observations(plane, &self.arc)?)
            }
            sweep::Model::Reciprocal => Box::new(Planes::from_observations(first, &self.arc)?),
            sweep::Model::Planes => Box::new(Planes::from_observations(&self.planes, &self.arc)?),
        })
    }
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
