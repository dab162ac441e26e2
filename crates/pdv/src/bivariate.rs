use brdf::Brdf;
use glam::{DVec3, Vec4};

use crate::bisected::{Bisected, Pair};
use crate::model::Basis;
use crate::surface::Surface;
use crate::sweeps::Sweeps;
use crate::table::{LOG_MAX, exp2, logs};
use crate::{Error, FactorTable, Model, Observation, Shape};

/// Nodes over either angle.
const NODES: usize = 90;
/// ln f is what is interpolated: the product of lobe and arc, without floor, shadowing or darkening.
const PRODUCT: Shape = Shape {
    scale: 1e6,
    diffuse: 0.0,
    shadowing: 1.0,
    darkening: 0.0,
};

/// The bivariate baseline: f is taken to depend on half and difference angle alone (Romeiro, Vasilyev, Zickler 2008).
///
/// A table of ln f at 90 × 90 nodes, even in √tan(θ_h/2) and in tan(θ_d/2), which are nearly as even as √θ_h and θ_d and
/// need no arctangent, from the readings in the plane: along a side they are interpolated over θ_h, between the sides
/// and the arc over θ_d. Beyond the largest half angle, and where θ_h + θ_d passes the horizon, it is held.
#[derive(Clone, Debug, PartialEq)]
pub struct Bivariate {
    surface: Surface,
    /// log₂ of RGB, θ_h fastest, and a number that is loaded and not used.
    logs: Vec<f32>,
    /// 0 in a black channel, else 1, and a number that is not used.
    light: Vec4,
    dropped: usize,
}

impl Bivariate {
    /// The model of planes and an arc; what cannot be used is dropped and counted as for [`crate::Planes`].
    ///
    /// # Errors
    /// As [`crate::Planes::from_observations`].
    ///
    /// ```
    /// # use pdv::Observation;
    /// # let gold = brdf::Fitted::named("gold-paint").expect("one of the fitted materials");
    /// # let plane = |theta_r: f64| -> Vec<Observation> {
    /// #     let deviations = [-0.04, 0.0, 0.02, 0.06, 0.15, 0.4, 0.8];
    /// #     deviations.iter().filter_map(|&d| Observation::of(&gold, theta_r, d)).collect()
    /// # };
    /// # let arc: Vec<_> = [0.1, 0.5, 0.9, 1.3].iter().filter_map(|&t| Observation::of(&gold, t, 0.0)).collect();
    ///
    /// use brdf::Brdf;
    ///
    /// let model = pdv::Bivariate::from_observations(&[plane(0.3), plane(1.0)], &arc)?;
    /// let (incident, exitant) = plane(1.0)[5].pdv().directions().expect("it was read there");
    /// assert!((model.eval(incident, exitant) / plane(1.0)[5].rgb - 1.0).abs().max_element() < 0.1);
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn from_observations(planes: &[Vec<Observation>], arc: &[Observation]) -> Result<Self, Error> {
        let sweeps = Sweeps::new(planes, arc)?;
        let surface = Surface::new(&sweeps, PRODUCT)?;
        let mut nodes = Vec::with_capacity(3 * NODES * NODES + 1);
        for row in 0..NODES {
            for column in 0..NODES {
                let share = |n: usize| n as f64 / (NODES - 1) as f64;
                let pose = Bisected {
                    theta_h: 2.0 * share(column).powi(2).atan(),
                    theta_d: 2.0 * share(row).atan(),
                };
                nodes.extend(logs(surface.at(pose, None)).to_array());
            }
        }
        nodes.push(0.0);
        Ok(Self {
            surface,
            logs: nodes,
            light: sweeps.light().as_vec3().extend(0.0),
            dropped: sweeps.dropped,
        })
    }
}

impl Brdf for Bivariate {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return DVec3::ZERO;
        }
        let (sum, difference) = (incident + exitant, incident - exitant);
        let flat = sum.x * sum.x + sum.y * sum.y;
        let length = (flat + sum.z * sum.z).sqrt() as f32;
        // tan(θ/2) = sin θ/(1 + cos θ); |ω_i − ω_o| = 2 sin θ_d and |ω_i + ω_o| = 2 cos θ_d.
        let half = flat.sqrt() as f32 / (length + sum.z as f32).max(f32::MIN_POSITIVE);
        let between = difference.length() as f32 / (2.0 + length);
        let place = |share: f32| {
            let place = share.clamp(0.0, 1.0) * (NODES - 1) as f32;
            let cell = (place as usize).min(NODES - 2);
            (cell, place - cell as f32)
        };
        let (column, across) = place(half.sqrt());
        let (row, along) = place(between);
        let near = |row: usize| {
            let first = 3 * (row * NODES + column);
            let pair = &self.logs[first..first + 7];
            let (a, b) = (Vec4::from_slice(&pair[..4]), Vec4::from_slice(&pair[3..]));
            a + (b - a) * across
        };
        let (a, b) = (near(row), near(row + 1));
        // What is no number is dark.
        let log = (a + (b - a) * along).max(Vec4::splat(-LOG_MAX));
        exp2(log, self.light).truncate().as_dvec3()
    }
}

impl Model for Bivariate {
    fn basis(&self, incident: DVec3, exitant: DVec3) -> Basis {
        self.surface.basis(Pair::new(incident, exitant).bisected())
    }

    fn about(&self) -> String {
        format!(
            "the bivariate table over half and difference angle of {} sides of planes and an arc; {} readings dropped",
            self.surface.lobe.rows().count(),
            self.dropped
        )
    }

    fn factors(&self) -> Vec<FactorTable> {
        self.surface.factors()
    }
}
