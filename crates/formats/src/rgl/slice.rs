use std::f64::consts::FRAC_PI_2;

use brdf::{Brdf, Spherical};
use glam::DVec3;
use rayon::prelude::*;

use super::facets::Facets;
use super::loss::loss;
use super::measured::{Measured, normal, u_of_theta};
use super::warp::Warp;
use crate::colour::luminance;
use crate::coordinates::lifted;

/// Shares of even density beside the one that follows f cos θ, and powers of that one, which are tried.
const DENSITIES: [(f64, f64); 6] = [
    (0.2, 1.0),
    (0.5, 1.0),
    (0.2, 0.5),
    (0.5, 0.5),
    (0.8, 1.0),
    (0.8, 0.5),
];
/// Spread of the weights of samples that is as bad as what is lost once more.
const SPREAD: f64 = 0.1;

/// How a slice is sampled.
#[derive(Clone, Copy)]
pub(crate) struct Shape {
    /// Nodes of a side of the square of s.
    pub(crate) side: usize,
    /// Azimuths and zenith angles of the density of visible normals.
    pub(crate) normals: [usize; 2],
    /// Share of even density.
    pub(crate) even: f64,
    /// Power of f cos θ in the rest.
    pub(crate) power: f64,
}

impl Shape {
    /// The density with which a few slices come out best: they lose little, and the weights of samples hardly differ.
    pub(crate) fn chosen(brdf: &dyn Brdf, facets: &Facets) -> Self {
        let shapes = DENSITIES.map(|(even, power)| Self {
            side: 48,
            normals: [48, 96],
            even,
            power,
        });
        let cost = |shape: &Self| {
            let cost = |theta_i: f64| {
                let slice = Slice::new(brdf, facets, *shape, theta_i);
                slice.error(brdf, facets) * (1.0 + slice.spread(brdf) / SPREAD)
            };
            [5.0_f64, 30.0, 55.0, 75.0]
                .map(|degrees| cost(degrees.to_radians()))
                .iter()
                .sum::<f64>()
        };
        let costs: Vec<f64> = shapes.par_iter().map(cost).collect();
        let best = (0..shapes.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b]));
        shapes[best.unwrap_or_default()]
    }

    /// Densities of normals at the nodes of the unit square, azimuth by azimuth, with a mean of 1.
    fn density(self, brdf: &dyn Brdf, theta_i: f64) -> Vec<f64> {
        let [rows, columns] = self.normals;
        let place = |n: usize| {
            let share = |n: usize, nodes: usize| n as f64 / (nodes - 1) as f64;
            [share(n % columns, columns), share(n / columns, rows)]
        };
        let targets: Vec<Target> = (0..rows * columns)
            .map(|n| Target::at(brdf, theta_i, place(n)))
            .collect();
        let follow = |at: &Target| at.f_cos.powf(self.power) * at.turn;
        let flat = |at: &Target| if at.exitant.z > 0.0 { 1.0 } else { 1e-3 };
        let mean = |of: &dyn Fn(&Target) -> f64| {
            (targets.iter().map(of).sum::<f64>() / targets.len() as f64).max(f64::MIN_POSITIVE)
        };
        let (follows, flats) = (mean(&follow), mean(&flat));
        let mixed = |at| (1.0 - self.even) * follow(at) / follows + self.even * flat(at) / flats;
        targets.iter().map(|at| f64::from(mixed(at) as f32)).collect()
    }

    /// Bytes of a slice in a file.
    pub(crate) fn bytes(self) -> usize {
        4 * (self.normals[0] * self.normals[1] + 4 * self.side * self.side)
    }
}

/// All of one angle of incidence.
pub(crate) struct Slice {
    pub(crate) theta_i: f64,
    pub(crate) shape: Shape,
    /// Density of normals, azimuth by azimuth.
    pub(crate) density: Vec<f64>,
    /// What is stored, row by row.
    pub(crate) values: Vec<DVec3>,
    /// Density with which s is drawn.
    pub(crate) luminance: Vec<f64>,
}

/// What is at a place of the unit square of microfacet normals, for light at azimuth 0.
struct Target {
    exitant: DVec3,
    /// Luminance of f cos θ_o; 0 below the horizon.
    f_cos: f64,
    /// Solid angle of exitant directions per area of the square.
    turn: f64,
}

impl Target {
    fn at(brdf: &dyn Brdf, theta_i: f64, u: [f64; 2]) -> Self {
        let incident = light(theta_i);
        let m = normal(u);
        let exitant = 2.0 * incident.dot(m) * m - incident;
        let above = incident.dot(m) > 0.0 && exitant.z > 0.0;
        Self {
            exitant,
            f_cos: match above {
                true => luminance(lifted(brdf, incident, exitant)) * exitant.z,
                false => 0.0,
            },
            turn: 4.0 * incident.dot(m).max(0.0) * (u[0] * u[0] * FRAC_PI_2).sin() * u[0],
        }
    }
}

/// The direction to the light.
fn light(theta_i: f64) -> DVec3 {
    Spherical {
        theta: theta_i,
        phi: 0.0,
    }
    .direction()
}

impl Slice {
    pub(crate) fn new(brdf: &dyn Brdf, facets: &Facets, shape: Shape, theta_i: f64) -> Self {
        let density = shape.density(brdf, theta_i);
        let [rows, columns] = shape.normals;
        let warp = Warp::new(vec![theta_i], rows, columns, density.clone());
        let (ndf, sigma) = facets.planes();
        let sigma = sigma.at([u_of_theta(theta_i), 0.5]);
        let side = shape.side;
        let nodes: Vec<(DVec3, f64)> = (0..side * side)
            .map(|n| {
                let s = [n % side, n / side].map(|n| n as f64 / (side - 1) as f64);
                let (u, density) = warp.sample(0, s);
                let target = Target::at(brdf, theta_i, u);
                let f = lifted(brdf, light(theta_i), target.exitant);
                let value = f * (target.exitant.z.max(0.0) * 4.0 * sigma / ndf.at(u));
                (
                    value.as_vec3().as_dvec3(),
                    target.f_cos * target.turn / density.max(1e-9),
                )
            })
            .collect();
        let most = nodes
            .iter()
            .map(|(_, light)| *light)
            .fold(0.0, f64::max)
            .max(f64::MIN_POSITIVE);
        Self {
            theta_i,
            shape,
            density,
            values: nodes.iter().map(|(value, _)| *value).collect(),
            luminance: nodes.iter().map(|(_, light)| light / most + 1e-4).collect(),
        }
    }

    /// Standard deviation of the weights of samples that are drawn as a reader draws them, as a share of their mean: half-way
    /// between the nodes of s.
    fn spread(&self, brdf: &dyn Brdf) -> f64 {
        let [rows, columns] = self.shape.normals;
        let warp = Warp::new(vec![self.theta_i], rows, columns, self.density.clone());
        let side = self.shape.side;
        let (mut light, mut drawn, mut squares) = (0.0, 0.0, 0.0);
        for n in 0..(side - 1) * (side - 1) {
            let (x, y) = (n % (side - 1), n / (side - 1));
            let (u, density) = warp.sample(0, [x, y].map(|n| (n as f64 + 0.5) / (side - 1) as f64));
            let target = Target::at(brdf, self.theta_i, u);
            let share = target.f_cos * target.turn / density.max(1e-9);
            let at = y * side + x;
            let corners = [at, at + 1, at + side, at + side + 1].map(|at| self.luminance[at]);
            let probability = corners.iter().sum::<f64>() / 4.0;
            light += share;
            drawn += probability;
            squares += share * share / probability;
        }
        (squares * drawn / (light * light).max(f64::MIN_POSITIVE) - 1.0)
            .max(0.0)
            .sqrt()
    }

    /// The BRDF of some slices, as a reader has it.
    pub(crate) fn measured(slices: &[&Self], facets: &Facets) -> Measured {
        let [rows, columns] = slices[0].shape.normals;
        let (ndf, sigma) = facets.planes();
        let theta_i = slices.iter().map(|slice| slice.theta_i).collect();
        let density = slices
            .iter()
            .flat_map(|slice| slice.density.iter().copied())
            .collect();
        let warp = Warp::new(theta_i, rows, columns, density);
        let values = slices
            .iter()
            .flat_map(|slice| slice.values.iter().copied())
            .collect();
        Measured::new(ndf, sigma, warp, slices[0].shape.side, values)
    }

    /// What is lost at this slice's own angle of incidence.
    pub(crate) fn error(&self, brdf: &dyn Brdf, facets: &Facets) -> f64 {
        loss(brdf, &Self::measured(&[self], facets), self.theta_i)
    }
}
