use pdv::{Distribution, Scene};

use crate::{Arc, Plane};

/// Zenith angle, rad, up to which a scene begins with one plane: beyond it what is bent out of one plane is too wrong.
const NEAR: f64 = 65.0 * std::f64::consts::PI / 180.0;
/// Where that plane stands, as a share of the largest zenith angle of the scene.
const SHARE: f64 = 0.75;
/// Where the planes of any other job stand, degrees.
const FAR_DEG: [f64; 2] = [20.0, 70.0];
/// Readings of each plane.
const READINGS: usize = 16;
/// Readings of the arc beside one plane, and beside two.
const ARC: [usize; 2] = [4, 8];

/// The sweeps with which a job begins that leaves them to the program: the fewest from which the expected error, and
/// what would lower it, can be told.
///
/// docs/adaptive.md says what they were chosen by.
pub(crate) fn first(scene: Option<&Scene>) -> (Vec<Plane>, Arc) {
    let reach = scene.map_or(f64::INFINITY, Scene::reach);
    let (planes, readings) = if reach <= NEAR {
        (vec![SHARE * reach], ARC[0])
    } else {
        (FAR_DEG.map(f64::to_radians).to_vec(), ARC[1])
    };
    let plane = |theta_r| Plane {
        theta_r,
        readings: READINGS,
        distribution: Distribution::Lobe,
    };
    let arc = Arc {
        readings,
        offset: 0.0,
    };
    (planes.into_iter().map(plane).collect(), arc)
}
