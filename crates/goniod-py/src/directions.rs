use std::borrow::Cow;

use brdf::Spherical;
use numpy::ndarray::IxDyn;
use numpy::{AllowTypeChange, IntoPyArray, PyArray, PyArrayLikeDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Numbers of any shape, as numpy makes them of what a caller gives.
pub(crate) type Numbers<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// An array of any shape for a caller.
pub(crate) type Array<'py, T> = Bound<'py, PyArray<T, IxDyn>>;

/// How far the length of a unit vector may be from 1: what f32 loses, and some arithmetic with it.
const ROUNDING: f64 = 1e-5;

/// Directions of a caller: unit vectors and the shape in which they came.
pub(crate) struct Directions<'a> {
    vectors: Cow<'a, [[f64; 3]]>,
    shape: Vec<usize>,
}

/// Pairs of directions, one result each.
pub(crate) struct Pairs<'a> {
    pub(crate) incident: Cow<'a, [[f64; 3]]>,
    pub(crate) exitant: Cow<'a, [[f64; 3]]>,
    shape: Vec<usize>,
}

impl<'a> Directions<'a> {
    /// Reads unit vectors, shape (…, 3), or zenith angles and azimuths in rad, shape (…, 2).
    pub(crate) fn read(what: &str, numbers: &'a Numbers<'_>) -> PyResult<Self> {
        let (&last, shape) = numbers.shape().split_last().unwrap_or((&0, &[]));
        // Rows one after the other; what numpy calls contiguous may have its columns so.
        let all: Cow<'a, [f64]> = match numbers.as_array().to_slice() {
            Some(all) => Cow::Borrowed(all),
            None => Cow::Owned(numbers.as_array().iter().copied().collect()),
        };
        let vectors: Cow<'a, [[f64; 3]]> = match (last, all) {
            (3, Cow::Borrowed(all)) => Cow::Borrowed(all.as_chunks().0),
            (3, Cow::Owned(all)) => Cow::Owned(all.as_chunks().0.to_vec()),
            (2, all) => Cow::Owned(all.as_chunks().0.iter().map(vector).collect()),
            _ => {
                return Err(PyValueError::new_err(format!(
                    "{what} has the shape {:?}; allowed are (…, 3), unit vectors, and (…, 2), zenith angles and azimuths in rad",
                    numbers.shape()
                )));
            }
        };
        Ok(Self {
            vectors,
            shape: shape.to_vec(),
        })
    }

    /// The vectors, in the order of the array.
    ///
    /// # Errors
    /// One of them is no unit vector.
    pub(crate) fn checked(&self, what: &str) -> PyResult<&[[f64; 3]]> {
        match all_units(&self.vectors) {
            true => Ok(&self.vectors),
            false => Err(no_unit(what, &self.vectors)),
        }
    }

    /// The shape without the axis of the components.
    pub(crate) fn shape(&self) -> &[usize] {
        &self.shape
    }
}

impl<'a> Pairs<'a> {
    /// Reads pairs: arrays of one shape, or a single direction for all of the other array.
    pub(crate) fn read(incident: &'a Numbers<'_>, exitant: &'a Numbers<'_>) -> PyResult<Self> {
        let incident = Directions::read("incident", incident)?;
        let exitant = Directions::read("exitant", exitant)?;
        let repeated = |one: &Directions<'_>, many: usize| Cow::Owned(vec![one.vectors[0]; many]);
        let (incident, exitant, shape) = match (incident.shape.is_empty(), exitant.shape.is_empty()) {
            _ if incident.shape == exitant.shape => (incident.vectors, exitant.vectors, exitant.shape),
            (true, _) => (
                repeated(&incident, exitant.vectors.len()),
                exitant.vectors,
                exitant.shape,
            ),
            (_, true) => {
                let repeated = repeated(&exitant, incident.vectors.len());
                (incident.vectors, repeated, incident.shape)
            }
            _ => {
                return Err(PyValueError::new_err(format!(
                    "incident has {:?} directions and exitant {:?}; allowed are equal shapes, or a single direction for all \
                     of the other",
                    incident.shape, exitant.shape
                )));
            }
        };
        Ok(Self {
            incident,
            exitant,
            shape,
        })
    }

    /// What to say where [`all_units`] does not hold for them.
    pub(crate) fn complaint(&self) -> PyErr {
        match all_units(&self.incident) {
            true => no_unit("exitant", &self.exitant),
            false => no_unit("incident", &self.incident),
        }
    }

    /// The shape of the pairs.
    pub(crate) fn shape(&self) -> &[usize] {
        &self.shape
    }
}

/// An array of the shape that the caller's had, with `width` numbers for each direction, or one and no axis of its own.
pub(crate) fn shaped<'py, T: numpy::Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
    width: Option<usize>,
) -> PyResult<Array<'py, T>> {
    let shape: Vec<usize> = shape.iter().copied().chain(width).collect();
    values.into_pyarray(py).reshape(IxDyn(&shape))
}

fn vector(&[theta, phi]: &[f64; 2]) -> [f64; 3] {
    Spherical { theta, phi }.direction().to_array()
}

/// Whether all of some vectors are unit vectors: one branch for all of them, so that it costs next to nothing.
pub(crate) fn all_units(vectors: &[[f64; 3]]) -> bool {
    vectors.iter().fold(true, |good, v| good & unit(v))
}

fn no_unit(what: &str, vectors: &[[f64; 3]]) -> PyErr {
    let at = vectors.iter().position(|v| !unit(v)).unwrap_or_default();
    let vector = vectors.get(at).copied().unwrap_or_default();
    PyValueError::new_err(format!(
        "{what} number {at} is {vector:?}; allowed are unit vectors of finite numbers, to {ROUNDING} of their length"
    ))
}

fn unit([x, y, z]: &[f64; 3]) -> bool {
    // What is no number is not below.
    (x * x + y * y + z * z - 1.0).abs() < 2.0 * ROUNDING
}
