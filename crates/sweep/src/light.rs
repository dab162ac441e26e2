use arms::Pose;
use serde::Serialize;

use crate::route::{Standing, route};
use crate::{Mechanics, Plan};

/// What the choice of exposures may make of a plan's time, seconds.
///
/// How bright a specimen is shows only when it is measured; then each reading gets the exposure that its neighbours call
/// for, and another one where it came out saturated or too dim.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Light {
    /// Readings whose exposure is chosen on the way.
    pub readings: usize,
    /// Integration as it is in the plan's seconds, the fixed one of dark readings too; in flight with what the bus needs
    /// between two.
    pub foreseen_s: f64,
    /// The same if the specimen were so bright that the shortest integration did for every reading.
    pub least_s: f64,
    /// The same if it were so dark that every reading took the longest.
    pub most_s: f64,
    /// What another exposure of one reading is expected to add.
    pub again_s: f64,
    /// The whole plan, if every reading were exposed as often as may be, for the longest time, and those in flight at
    /// rest. No run takes longer but by faults, pauses and what is added to an open plan.
    pub worst_s: f64,
}

impl Light {
    /// Of a plan that these mechanics made.
    pub fn new(plan: &Plan, mechanics: &Mechanics) -> Self {
        let [shortest_s, longest_s] = mechanics.integration_us.map(|us| f64::from(us) * 1e-6);
        let foreseen_s = mechanics.integration_s();
        let often_s = f64::from(mechanics.exposures) * (longest_s + mechanics.transaction_s);
        let mut light = Self {
            readings: 0,
            foreseen_s: 0.0,
            least_s: 0.0,
            most_s: 0.0,
            again_s: foreseen_s + mechanics.transaction_s,
            worst_s: plan.seconds(),
        };
        let mut from = None;
        for step in &plan.steps {
            let each_s = match (step.exposure, step.pass) {
                (Some((_, integration_us)), _) => [f64::from(integration_us) * 1e-6; 3],
                (None, Some(_)) => [mechanics.flight_s, shortest_s, longest_s],
                (None, None) => [foreseen_s, shortest_s, longest_s],
            };
            light.foreseen_s += each_s[0];
            light.least_s += each_s[1];
            light.most_s += each_s[2];
            if step.exposure.is_none() {
                light.readings += 1;
                light.worst_s += match step.pass {
                    Some(_) => often_s + mechanics.rest_s() + way_s(mechanics, from, step.pose()),
                    None => often_s - light.again_s,
                };
            }
            from = Some(step.pose());
        }
        light
    }
}

/// Seconds of motion to a pose from the one before.
fn way_s(mechanics: &Mechanics, from: Option<Pose>, to: Pose) -> f64 {
    let standing = from.map(|pose| Standing {
        pose,
        approached: true,
    });
    let route = standing.and_then(|standing| route(mechanics, standing, to));
    route.map_or(0.0, |route| route.seconds)
}
