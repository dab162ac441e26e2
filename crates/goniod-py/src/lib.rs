//! The compiled half of the Python package `goniod`: BRDFs, models of readings, samplers and metrics over numpy arrays.
//!
//! Everything here checks shapes and values, lets go of Python's lock, and calls the crates that do the work. The other
//! half is Python, in `python/goniod`.

mod directions;
mod error;
mod metrics;
mod model;
mod parallel;
mod reflectance;
mod sampler;

use std::path::PathBuf;
use std::sync::Arc;

use brdf::Fitted;
use formats::FORMATS;
use pyo3::prelude::*;

use crate::error::raised;
use crate::reflectance::PyBrdf;

/// Reads a BRDF from a file of any format that goniod reads; its content tells which.
///
/// >>> import goniod, pathlib, tempfile
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "paint.txt"
/// >>> figures = goniod.material("blue-rubber").save(path, "ssdd")
/// >>> goniod.load(path).eval([0, 0, 1], [0, 0, 1]).shape
/// (3,)
#[pyfunction]
fn load(py: Python<'_>, path: PathBuf) -> PyResult<PyBrdf> {
    let (_, brdf) = py
        .detach(|| formats::read(&path))
        .map_err(|error| raised(&error))?;
    Ok(PyBrdf::new(Arc::from(brdf), path.display().to_string()))
}

/// The BRDF that a text names: one of `materials()`, "black", "lambert:ALBEDO" or "mirror:REFLECTANCE".
///
/// >>> import goniod
/// >>> goniod.material("alum-bronse")
/// Traceback (most recent call last):
///     ...
/// ValueError: unknown specimen "alum-bronse", did you mean alum-bronze?; allowed are a fitted MERL material (the empty name "" lists all 100), "black", "lambert:ALBEDO", "mirror:REFLECTANCE" and the path of a .binary file
#[pyfunction]
fn material(name: &str) -> PyResult<PyBrdf> {
    let brdf = brdf::specimen(name).map_err(|error| raised(&error))?;
    Ok(PyBrdf::new(brdf, name.trim()))
}

/// Names of the 100 materials of the MERL database that are built in as fits.
///
/// >>> import goniod
/// >>> len(goniod.materials())
/// 100
#[pyfunction]
fn materials() -> Vec<&'static str> {
    Fitted::all().map(|(name, _)| name).collect()
}

/// Name, extension and description of every file format.
///
/// >>> import goniod
/// >>> [extension for name, extension, about in goniod.formats() if name == "merl"]
/// ['binary']
#[pyfunction(name = "formats")]
fn formats_() -> Vec<(&'static str, &'static str, &'static str)> {
    FORMATS
        .iter()
        .map(|format| (format.name, format.extension, format.about))
        .collect()
}

/// The compiled half of the package `goniod`.
#[pymodule]
mod _goniod {
    #[pymodule_export]
    use super::{formats_, load, material, materials};
    #[pymodule_export]
    use crate::metrics::{compare, spheres};
    #[pymodule_export]
    use crate::model::{PyFactor, PyModel, fit_rows, model_of_job};
    #[pymodule_export]
    use crate::reflectance::PyBrdf;
    #[pymodule_export]
    use crate::sampler::PySampler;
}
