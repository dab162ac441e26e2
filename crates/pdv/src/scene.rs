use std::f64::consts::{FRAC_PI_2, PI};

use brdf::Spherical;
use glam::DVec3;
use serde::Serialize;

/// Steps of the zenith angles and of the azimuth, rad, with which pairs are looked at.
const STEP: f64 = PI / 90.0;
const TURN: f64 = PI / 36.0;
/// What rounding may carry an angle beyond its range, rad.
const ROUNDING: f64 = 1e-9;

/// The pairs of directions that will be looked at, whatever their azimuths, and the channels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scene {
    /// Ranges of zenith angles, at least one. A pair is in the scene where any of them holds it.
    pub cells: Vec<Cell>,
    /// Whether red, green and blue are wanted.
    pub channels: [bool; 3],
}

/// Pairs of directions by the ranges of their zenith angles, rad, 0 … π/2.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cell {
    /// Of the light, least and largest.
    pub theta_i: [f64; 2],
    /// Of the viewer, least and largest.
    pub theta_o: [f64; 2],
    /// How often pairs in it are looked at, relative to the other cells, above 0.
    pub weight: f64,
}

impl Cell {
    /// The whole hemisphere, for light and viewer.
    pub const WHOLE: Self = Self {
        theta_i: [0.0, FRAC_PI_2],
        theta_o: [0.0, FRAC_PI_2],
        weight: 1.0,
    };

    fn holds(&self, theta_i: f64, theta_o: f64) -> bool {
        let within = |[low, high]: [f64; 2], theta: f64| low - ROUNDING <= theta && theta <= high + ROUNDING;
        within(self.theta_i, theta_i) && within(self.theta_o, theta_o)
    }
}

impl Scene {
    /// Everything.
    pub fn whole() -> Self {
        Self {
            cells: vec![Cell::WHOLE],
            channels: [true; 3],
        }
    }

    /// Whether light and viewer are looked at as they are.
    ///
    /// ```
    /// use glam::DVec3;
    /// use pdv::{Cell, Scene};
    ///
    /// let half = Cell { theta_i: [0.0, 0.5], theta_o: [0.0, 1.0], weight: 1.0 };
    /// let scene = Scene { cells: vec![half], ..Scene::whole() };
    /// let at_45_deg = DVec3::new(1.0, 0.0, 1.0).normalize();
    /// assert!(scene.holds(DVec3::Z, at_45_deg) && !scene.holds(at_45_deg, DVec3::Z));
    /// assert_eq!(scene.reach(), 1.0);
    /// ```
    pub fn holds(&self, incident: DVec3, exitant: DVec3) -> bool {
        let [theta_i, theta_o] =
            [incident, exitant].map(|direction| Spherical::from_direction(direction).theta);
        self.cells.iter().any(|cell| cell.holds(theta_i, theta_o))
    }

    /// The largest zenith angle of any light or viewer in it, rad.
    pub fn reach(&self) -> f64 {
        let farthest = |cell: &Cell| cell.theta_i[1].max(cell.theta_o[1]);
        self.cells.iter().map(farthest).fold(0.0, f64::max)
    }

    /// The cells as far as they reach below a zenith angle, rad; as they are where none does.
    pub(crate) fn below(&self, theta_max: f64) -> Vec<Cell> {
        let cut = |[low, high]: [f64; 2]| [low, high.min(theta_max)];
        let below = |cell: &&Cell| cell.theta_i[0] < theta_max && cell.theta_o[0] < theta_max;
        let cells = self.cells.iter().filter(below).map(|cell| Cell {
            theta_i: cut(cell.theta_i),
            theta_o: cut(cell.theta_o),
            ..*cell
        });
        let cells: Vec<Cell> = cells.collect();
        if cells.is_empty() {
            self.cells.clone()
        } else {
            cells
        }
    }

    /// Pairs all over the scene, its edges included, at even steps of the angles: 2° and 5°.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (DVec3, DVec3)> {
        let azimuths = (PI / TURN).round() as usize;
        self.cells.iter().flat_map(move |cell| {
            steps(cell.theta_i).flat_map(move |theta_i| {
                steps(cell.theta_o).flat_map(move |theta_o| {
                    (0..=azimuths).map(move |n| {
                        let direction = |theta, phi| Spherical { theta, phi }.direction();
                        (direction(theta_i, n as f64 * TURN), direction(theta_o, 0.0))
                    })
                })
            })
        })
    }
}

/// Angles from one end of a range to the other, both included.
fn steps([low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
    let steps = ((high - low) / STEP).ceil().max(1.0);
    (0..=steps as usize).map(move |n| low + (high - low) * n as f64 / steps)
}
