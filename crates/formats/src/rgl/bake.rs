use std::f64::consts::PI;

use brdf::Brdf;
use rayon::prelude::*;

use super::TOLERANCE;
use super::facets::{Facets, NDF, SIGMA};
use super::loss::loss;
use super::measured::Measured;
use super::slice::{Shape, Slice};
use super::tensor::{Field, Kind, Tensor};
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
    let shape = slices[0].shape;
    let (t, side, [rows, columns]) = (slices.len(), shape.side, shape.normals);
    let lines = export.metadata.lines();
    let lines: Vec<String> = lines
        .iter()
        .map(|(name, value)| format!("{name}: {value}"))
        .collect();
    // A file has its wavelengths in ascending order; channels go with them.
    let mut order: Vec<(usize, f64)> = export.metadata.wavelengths_nm.into_iter().enumerate().collect();
    let name = match channels {
        Channels::Rgb => "rgb",
        Channels::Spectral => {
            order.sort_unstable_by(|a, b| a.1.total_cmp(&b.1));
            "spectra"
        }
    };
    let values = slices.iter().flat_map(|slice| {
        let channel = |&(channel, _): &(usize, f64)| slice.values.iter().map(move |value| value[channel]);
        order.iter().flat_map(channel)
    });
    // Two rows that are the same: readers divide by the number of rows less one.
    let twice = |values: &[f64]| [values, values].concat();
    let mut fields = vec![
        Field {
            name: b"version",
            kind: Kind::U32,
            shape: vec![2],
            data: [1_u32.to_le_bytes(), 0_u32.to_le_bytes()].concat().into(),
        },
        Field::bytes("description", lines.join("\n").into_bytes()),
        Field::floats("phi_i", &[1], [0.0]),
        Field::floats("theta_i", &[t], slices.iter().map(|slice| slice.theta_i)),
        Field::floats("sigma", &[2, SIGMA], twice(&facets.sigma)),
        Field::floats("ndf", &[2, NDF], twice(&facets.ndf)),
        Field::floats(
            "vndf",
            &[1, t, rows, columns],
            slices.iter().flat_map(|slice| slice.density.clone()),
        ),
        Field::floats(
            "luminance",
            &[1, t, side, side],
            slices.iter().flat_map(|slice| slice.luminance.clone()),
        ),
        Field::floats(name, &[1, t, 3, side, side], values),
        Field::bytes("jacobian", vec![1]),
    ];
    if channels == Channels::Spectral {
        fields.insert(
            4,
            Field::floats("wavelengths", &[3], order.iter().map(|(_, nm)| *nm)),
        );
    }
    Tensor(fields).write()
}
