use std::f64::consts::{FRAC_PI_2, PI};

use brdf::{Brdf, HalfDifference, Spherical};
use glam::DVec3;
use rayon::prelude::*;

use super::TOLERANCE;
use super::loss::loss;
use super::measured::{Measured, Plane, normal, u_of_theta};
use super::tensor::{Field, Kind, Tensor};
use super::warp::Warp;
use crate::colour::luminance;
use crate::coordinates::lifted;
use crate::{Error, Export, Fidelity};

/// Which numbers a file holds.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Channels {
    /// Red, green, blue.
    Rgb,
    /// Spectra at the wavelengths of the channels.
    Spectral,
}

/// Most bytes of a file.
const MOST_BYTES: usize = 5_000_000;
/// Nodes of D over u, θ = u² · 90°.
const NDF: usize = 1024;
/// Nodes of σ over u.
const SIGMA: usize = 256;
/// Last angle of incidence, rad: 89.9°, beyond which the last slice is held.
const LAST_RAD: f64 = 89.9 * PI / 180.0;
/// What is tried, one after the other: sides of the square of s, and how much of what is allowed may be lost between angles
/// of incidence.
const STEPS: [(usize, f64); 8] = [
    (32, 0.5),
    (48, 0.5),
    (48, 0.2),
    (64, 0.2),
    (64, 0.1),
    (64, 0.03),
    (80, 0.03),
    (96, 0.03),
];
/// Angles of incidence to begin with.
const FIRST_SLICES: usize = 9;
/// Shares of even density beside the one that follows f cos θ, and powers of that one, which are tried.
const DENSITIES: [(f64, f64); 6] = [
    (0.2, 1.0),
    (0.5, 1.0),
    (0.8, 1.0),
    (0.2, 0.5),
    (0.5, 0.5),
    (0.8, 0.5),
];

/// The bytes of the smallest tensor file that is within the tolerance, else of the best one up to 5 MB.
pub(crate) fn bake(export: &Export<'_>, channels: Channels) -> Result<Vec<u8>, Error> {
    let facets = Facets::new(export.brdf);
    let shape = Shape::chosen(export.brdf, &facets);
    let mut best: Option<(f64, Vec<u8>)> = None;
    for (side, target) in STEPS {
        let slices = slices(export.brdf, &facets, Shape { side, ..shape }, target);
        let bytes = file(export, channels, &facets, &slices);
        let fidelity = Fidelity::between(export.brdf, &Measured::read(&bytes)?);
        if TOLERANCE.exceeded(&fidelity).is_none() {
            return Ok(bytes);
        }
        let error = TOLERANCE.share(&fidelity);
        if best.as_ref().is_none_or(|(least, _)| error < *least) {
            best = Some((error, bytes));
        }
    }
    Ok(best.map(|(_, bytes)| bytes).unwrap_or_default())
}

/// The distribution D of microfacet normals and the projected area σ that goes with it.
struct Facets {
    ndf: Vec<f64>,
    sigma: Vec<f64>,
}

impl Facets {
    /// D is the shape that the lobe has over the half angle, on the average over difference angles; together with the
    /// normalisation ∫ D cos θ dω = 1 it gives σ(θ_i) = ∫ D max(0, m·ω_i) dω.
    fn new(brdf: &dyn Brdf) -> Self {
        let theta = |n: usize, nodes: usize| (n as f64 / (nodes - 1) as f64).powi(2) * FRAC_PI_2;
        let lobe = |theta_h: f64| {
            let at = |theta_d: f64| {
                let value = |theta_h: f64| {
                    let pair = HalfDifference {
                        theta_h,
                        theta_d,
                        phi_d: FRAC_PI_2,
                    };
                    let (incident, exitant) = pair.directions();
                    luminance(lifted(brdf, incident, exitant)).max(1e-9)
                };
                (value(theta_h) / value(0.0)).ln()
            };
            let sum: f64 = [0.0_f64, 20.0, 45.0]
                .map(|theta_d| at(theta_d.to_radians()))
                .iter()
                .sum();
            (sum / 3.0).exp().clamp(1e-9, 1e9)
        };
        let mut ndf: Vec<f64> = (0..NDF).map(|n| lobe(theta(n, NDF))).collect();
        // Rings of θ = u² π/2 about the normal, with the middle value of D.
        let rings: Vec<(f64, f64, f64)> = (0..NDF - 1)
            .map(|n| {
                let (low, high) = (theta(n, NDF), theta(n + 1, NDF));
                let middle = f64::midpoint(low, high);
                (
                    middle.sin(),
                    middle.cos(),
                    0.5 * (ndf[n] + ndf[n + 1]) * (low.cos() - high.cos()),
                )
            })
            .collect();
        let projected = |theta_i: f64| {
            let (sin_i, cos_i) = theta_i.sin_cos();
            let ring = |&(sin, cos, weight): &(f64, f64, f64)| {
                // ∫ max(0, a + b cos φ) dφ with a = cos θ cos θ_i and b = sin θ sin θ_i.
                let (a, b) = (cos * cos_i, sin * sin_i);
                let half = if a >= b {
                    PI
                } else {
                    (-a / b.max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0).acos()
                };
                2.0 * weight * (a * half + b * half.sin())
            };
            rings.iter().map(ring).sum::<f64>()
        };
        let whole = projected(0.0);
        ndf.iter_mut().for_each(|density| *density /= whole);
        let sigma = (0..SIGMA)
            .map(|n| (projected(theta(n, SIGMA)) / whole).max(1e-6))
            .collect();
        // As the file has them, so that their rounding is made good by what is divided by them.
        let single = |values: Vec<f64>| values.into_iter().map(|value| f64::from(value as f32)).collect();
        Self {
            ndf: single(ndf),
            sigma: single(sigma),
        }
    }

    fn planes(&self) -> (Plane, Plane) {
        (
            Plane::of_theta(self.ndf.clone()),
            Plane::of_theta(self.sigma.clone()),
        )
    }
}

/// How a slice is sampled.
#[derive(Clone, Copy)]
struct Shape {
    /// Nodes of a side of the square of s.
    side: usize,
    /// Azimuths and zenith angles of the density of visible normals.
    normals: [usize; 2],
    /// Share of even density.
    even: f64,
    /// Power of f cos θ in the rest.
    power: f64,
}

impl Shape {
    /// The density with which a few slices come out best.
    fn chosen(brdf: &dyn Brdf, facets: &Facets) -> Self {
        let shapes = DENSITIES.map(|(even, power)| Self {
            side: 48,
            normals: [48, 96],
            even,
            power,
        });
        let error = |shape: &Self| {
            let angles = [5.0_f64, 30.0, 55.0, 75.0].map(f64::to_radians);
            angles
                .map(|theta_i| Slice::new(brdf, facets, *shape, theta_i).error(brdf, facets))
                .iter()
                .sum::<f64>()
        };
        let errors: Vec<f64> = shapes.par_iter().map(error).collect();
        let best = (0..shapes.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b]));
        shapes[best.unwrap_or_default()]
    }

    /// Bytes of a slice in a file.
    fn bytes(self) -> usize {
        4 * (self.normals[0] * self.normals[1] + 4 * self.side * self.side)
    }
}

/// All of one angle of incidence.
struct Slice {
    theta_i: f64,
    shape: Shape,
    /// Density of normals, azimuth by azimuth.
    density: Vec<f64>,
    /// What is stored, row by row.
    values: Vec<DVec3>,
    /// Density with which s is drawn.
    luminance: Vec<f64>,
}

impl Slice {
    fn new(brdf: &dyn Brdf, facets: &Facets, shape: Shape, theta_i: f64) -> Self {
        let incident = Spherical {
            theta: theta_i,
            phi: 0.0,
        }
        .direction();
        let [rows, columns] = shape.normals;
        // Of a normal: f cos θ_o and the solid angle of exitant directions per area of the unit square.
        let target = |u: [f64; 2]| {
            let m = normal(u);
            let exitant = 2.0 * incident.dot(m) * m - incident;
            let above = incident.dot(m) > 0.0 && exitant.z > 0.0;
            let f_cos = match above {
                true => luminance(lifted(brdf, incident, exitant)) * exitant.z,
                false => 0.0,
            };
            let turn = 4.0 * incident.dot(m).max(0.0) * (u[0] * u[0] * FRAC_PI_2).sin() * u[0];
            (above, f_cos, turn)
        };
        let place = |n: usize| {
            let (row, column) = (n / columns, n % columns);
            [
                column as f64 / (columns - 1) as f64,
                row as f64 / (rows - 1) as f64,
            ]
        };
        let targets: Vec<(bool, f64, f64)> = (0..rows * columns).map(|n| target(place(n))).collect();
        let follow = |&(_, f_cos, turn): &(bool, f64, f64)| f_cos.powf(shape.power) * turn;
        let flat = |&(above, _, _): &(bool, f64, f64)| if above { 1.0 } else { 1e-3 };
        let sum_follow = targets.iter().map(follow).sum::<f64>().max(f64::MIN_POSITIVE);
        let sum_flat = targets.iter().map(flat).sum::<f64>().max(f64::MIN_POSITIVE);
        let density: Vec<f64> = targets
            .iter()
            .map(|at| (1.0 - shape.even) * follow(at) / sum_follow + shape.even * flat(at) / sum_flat)
            .map(|density| f64::from((density * (rows * columns) as f64) as f32))
            .collect();
        let warp = Warp::new(vec![theta_i], rows, columns, density.clone());
        let (ndf, sigma) = facets.planes();
        let sigma = sigma.at([u_of_theta(theta_i), 0.5]);
        let side = shape.side;
        let nodes: Vec<(DVec3, f64)> = (0..side * side)
            .map(|n| {
                let s = [n % side, n / side].map(|n| n as f64 / (side - 1) as f64);
                let (u, density) = warp.sample(0, s);
                let m = normal(u);
                let exitant = 2.0 * incident.dot(m) * m - incident;
                let f = lifted(brdf, incident, exitant);
                let value = f * (exitant.z.max(0.0) * 4.0 * sigma / ndf.at(u));
                let (_, f_cos, turn) = target(u);
                (value, f_cos * turn / density.max(1e-9))
            })
            .collect();
        let most = nodes
            .iter()
            .map(|(_, luminance)| *luminance)
            .fold(0.0, f64::max)
            .max(f64::MIN_POSITIVE);
        Self {
            theta_i,
            shape,
            density,
            values: nodes
                .iter()
                .map(|(value, _)| value.as_vec3().as_dvec3())
                .collect(),
            luminance: nodes
                .iter()
                .map(|(_, luminance)| luminance / most + 1e-4)
                .collect(),
        }
    }

    /// The BRDF of some slices, as a reader has it.
    fn measured(slices: &[&Self], facets: &Facets) -> Measured {
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
    fn error(&self, brdf: &dyn Brdf, facets: &Facets) -> f64 {
        loss(brdf, &Self::measured(&[self], facets), self.theta_i)
    }
}

/// Slices at the angles of incidence that the specimen needs: the interval in which interpolation loses most is halved
/// until the mean is a share `target` of what is allowed, or the file is full.
fn slices(brdf: &dyn Brdf, facets: &Facets, shape: Shape, target: f64) -> Vec<Slice> {
    let most = (MOST_BYTES - 20_000) / shape.bytes();
    let slice = |theta_i: f64| Slice::new(brdf, facets, shape, f64::from(theta_i as f32));
    let angles: Vec<f64> = (0..FIRST_SLICES)
        .map(|n| LAST_RAD * n as f64 / (FIRST_SLICES - 1) as f64)
        .collect();
    let mut slices: Vec<Slice> = angles.into_par_iter().map(slice).collect();
    let between = |low: &Slice, high: &Slice| {
        let middle = f64::midpoint(low.theta_i, high.theta_i);
        let excess = loss(brdf, &Slice::measured(&[low, high], facets), middle)
            - 0.5 * (low.error(brdf, facets) + high.error(brdf, facets));
        excess.max(0.0) * (high.theta_i - low.theta_i) / LAST_RAD
    };
    let mut errors: Vec<f64> = slices
        .par_windows(2)
        .map(|pair| between(&pair[0], &pair[1]))
        .collect();
    while slices.len() < most && errors.iter().sum::<f64>() > target {
        let Some(worst) = (0..errors.len()).max_by(|&a, &b| errors[a].total_cmp(&errors[b])) else {
            break;
        };
        let middle = f64::midpoint(slices[worst].theta_i, slices[worst + 1].theta_i);
        slices.insert(worst + 1, slice(middle));
        let halves: [f64; 2] = [worst, worst + 1].map(|n| between(&slices[n], &slices[n + 1]));
        errors.splice(worst..=worst, halves);
    }
    slices
}

/// The bytes of the file.
fn file(export: &Export<'_>, channels: Channels, facets: &Facets, slices: &[Slice]) -> Vec<u8> {
    let floats = |values: &[f64]| {
        values
            .iter()
            .flat_map(|&value| (value as f32).to_le_bytes())
            .collect::<Vec<u8>>()
    };
    let all = |of: fn(&Slice) -> &[f64]| {
        floats(
            &slices
                .iter()
                .flat_map(|slice| of(slice).iter().copied())
                .collect::<Vec<_>>(),
        )
    };
    let shape = slices[0].shape;
    let (t, side, [rows, columns]) = (slices.len(), shape.side, shape.normals);
    let lines = export.metadata.lines();
    let description = lines
        .iter()
        .map(|(name, value)| format!("{name}: {value}"))
        .collect::<Vec<_>>()
        .join("\n");
    let [red, green, blue] = export.metadata.wavelengths_nm;
    // A file has its wavelengths in ascending order; channels go with them.
    let mut order = [(0, red), (1, green), (2, blue)];
    if channels == Channels::Spectral {
        order.sort_unstable_by(|a, b| a.1.total_cmp(&b.1));
    }
    let mut values = Vec::with_capacity(t * 3 * side * side * 4);
    for slice in slices {
        for (channel, _) in order {
            values.extend(
                slice
                    .values
                    .iter()
                    .flat_map(|value| (value[channel] as f32).to_le_bytes()),
            );
        }
    }
    // Two rows that are the same: readers divide by the number of rows less one.
    let twice = |values: &[f64]| [floats(values), floats(values)].concat();
    let (theta_i, ndf, sigma) = (
        floats(&slices.iter().map(|slice| slice.theta_i).collect::<Vec<_>>()),
        twice(&facets.ndf),
        twice(&facets.sigma),
    );
    let (vndf, luminance) = (all(|slice| &slice.density), all(|slice| &slice.luminance));
    let (version, phi_i) = (
        [1_u32.to_le_bytes(), 0_u32.to_le_bytes()].concat(),
        floats(&[0.0]),
    );
    let nm = floats(&order.map(|(_, nm)| nm));
    let field = |name: &'static str, kind: Kind, shape: &[usize], data| Field {
        name: name.as_bytes(),
        kind,
        shape: shape.to_vec(),
        data,
    };
    let mut fields: Vec<Field<'_>> = vec![
        field("version", Kind::U32, &[2], &version),
        field(
            "description",
            Kind::U8,
            &[description.len()],
            description.as_bytes(),
        ),
        field("phi_i", Kind::F32, &[1], &phi_i),
        field("theta_i", Kind::F32, &[t], &theta_i),
    ];
    if channels == Channels::Spectral {
        fields.push(field("wavelengths", Kind::F32, &[3], &nm));
    }
    let name = if channels == Channels::Rgb {
        "rgb"
    } else {
        "spectra"
    };
    fields.extend([
        field("sigma", Kind::F32, &[2, SIGMA], &sigma),
        field("ndf", Kind::F32, &[2, NDF], &ndf),
        field("vndf", Kind::F32, &[1, t, rows, columns], &vndf),
        field("luminance", Kind::F32, &[1, t, side, side], &luminance),
        field(name, Kind::F32, &[1, t, 3, side, side], &values),
        field("jacobian", Kind::U8, &[1], &[1]),
    ]);
    Tensor(fields).write()
}
