use brdf::Brdf;
use glam::DVec3;

use crate::surface::Surface;
use crate::sweeps::Sweeps;
use crate::{Error, Observation, Shape};

/// What lies between the readings of planes and an arc, with a moderate shape that is not fitted: how steep a lobe is at a
/// reading, and how far it reaches to the next.
///
/// It gives back every reading of the planes, is made in a fraction of the time of a [`crate::Planes`], and is as good
/// beside the readings.
#[derive(Clone, Debug, PartialEq)]
pub struct InPlane(Surface);

impl InPlane {
    /// Interpolates readings; what cannot be used is dropped as for [`crate::Planes`].
    ///
    /// # Errors
    /// As [`crate::Planes::from_observations`].
    ///
    /// ```
    /// # let gold = brdf::Fitted::named("gold-paint").expect("one of the fitted materials");
    /// use brdf::Brdf;
    /// use pdv::{InPlane, Observation};
    ///
    /// let plane: Vec<_> = [-0.04, 0.0, 0.02, 0.06, 0.15, 0.4, 0.8]
    ///     .iter()
    ///     .filter_map(|&d| Observation::of(&gold, 0.7, d))
    ///     .collect();
    /// let between = InPlane::from_observations(&[plane.clone()], &[])?;
    /// let (incident, exitant) = plane[3].pdv().directions().expect("it was read there");
    /// assert!((between.eval(incident, exitant) / plane[3].rgb - 1.0).abs().max_element() < 1e-6);
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn from_observations(planes: &[Vec<Observation>], arc: &[Observation]) -> Result<Self, Error> {
        Ok(Self(Surface::new(&Sweeps::new(planes, arc)?, Shape::DEFAULT)?))
    }
}

impl Brdf for InPlane {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        self.0.eval(incident, exitant)
    }
}
