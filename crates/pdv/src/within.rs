use brdf::Brdf;
use glam::DVec3;

use crate::model::Basis;
use crate::{FactorTable, Model, Scene};

/// A model of which a scene asks for a part: elsewhere it is not valid, and its basis is [`Basis::NotMeasured`].
///
/// Where a pair is in the scene with light and viewer swapped alone, it answers for that one: MERL files hold one
/// number for both.
pub struct Within {
    model: Box<dyn Model>,
    scene: Scene,
}

impl Within {
    /// The part of a model that a scene asks for.
    pub fn new(model: Box<dyn Model>, scene: Scene) -> Self {
        Self { model, scene }
    }

    /// The pair as the scene has it; `None` outside of the scene.
    fn seen(&self, incident: DVec3, exitant: DVec3) -> Option<(DVec3, DVec3)> {
        [(incident, exitant), (exitant, incident)]
            .into_iter()
            .find(|&(incident, exitant)| self.scene.holds(incident, exitant))
    }
}

impl Brdf for Within {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        let (incident, exitant) = self.seen(incident, exitant).unwrap_or((incident, exitant));
        self.model.eval(incident, exitant)
    }

    fn valid(&self, incident: DVec3, exitant: DVec3) -> bool {
        self.seen(incident, exitant)
            .is_some_and(|(incident, exitant)| self.model.valid(incident, exitant))
    }
}

impl Model for Within {
    fn basis(&self, incident: DVec3, exitant: DVec3) -> Basis {
        match self.seen(incident, exitant) {
            Some((incident, exitant)) => self.model.basis(incident, exitant),
            None => Basis::NotMeasured,
        }
    }

    fn about(&self) -> String {
        format!(
            "{}; good for the scene that the job names, and not measured elsewhere",
            self.model.about()
        )
    }

    fn factors(&self) -> Vec<FactorTable> {
        self.model.factors()
    }
}
