use std::path::PathBuf;
use std::sync::Arc;

use brdf::Brdf;
use formats::{Export, FORMATS, Format, Metadata};
use glam::DVec3;
use numpy::PyArray2;
use numpy::{IntoPyArray, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::directions::{Array, Directions, Numbers, Pairs, shaped};
use crate::error::raised;
use crate::parallel::{fill, fill_in};

/// A bidirectional reflectance distribution function (BRDF): linear RGB in sr⁻¹ for pairs of directions.
///
/// Directions are unit vectors in the specimen frame, shape (…, 3), with z along the normal, or zenith angle and azimuth
/// in rad, shape (…, 2). `incident` points to the light and `exitant` to the viewer; one of them may be a single direction.
///
/// >>> import goniod, numpy as np
/// >>> grey = goniod.material("lambert:0.5")
/// >>> grey.eval([0.0, 0.0, 1.0], np.radians([[0.0, 0.0], [60.0, 90.0]])).round(4).tolist()
/// [[0.1592, 0.1592, 0.1592], [0.1592, 0.1592, 0.1592]]
#[pyclass(name = "Brdf", module = "goniod", subclass, frozen)]
pub(crate) struct PyBrdf {
    pub(crate) brdf: Arc<dyn Brdf>,
    name: String,
}

impl PyBrdf {
    pub(crate) fn new(brdf: Arc<dyn Brdf>, name: impl Into<String>) -> Self {
        Self {
            brdf,
            name: name.into(),
        }
    }
}

#[pymethods]
impl PyBrdf {
    /// What it is called: the name of a material, the path of a file, or what a model was made of.
    ///
    /// >>> import goniod
    /// >>> goniod.material("gold-paint").name
    /// 'gold-paint'
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    fn __repr__(&self) -> String {
        format!("<goniod BRDF {}>", self.name)
    }

    /// Evaluates pairs of directions: RGB in sr⁻¹, shape (…, 3); 0 where either is at or below the horizon.
    ///
    /// All cores work on it, and other Python threads go on meanwhile; RAYON_NUM_THREADS=1 keeps it to one core. `out` is an
    /// array of float64 that takes the result, where memory is to be used again.
    ///
    /// >>> import goniod, numpy as np
    /// >>> gold = goniod.material("gold-paint")
    /// >>> lights = np.radians([[30.0, 180.0], [30.0, 170.0]])
    /// >>> mirror, beside = gold.eval(lights, np.radians([30.0, 0.0]))[:, 0]
    /// >>> bool(mirror > beside)
    /// True
    #[pyo3(signature = (incident, exitant, *, out=None))]
    fn eval<'py>(
        &self,
        py: Python<'py>,
        incident: Numbers<'py>,
        exitant: Numbers<'py>,
        out: Option<Array<'py, f64>>,
    ) -> PyResult<Array<'py, f64>> {
        let pairs = Pairs::read(&incident, &exitant)?;
        let all = |incident: &[[f64; 3]], exitant: &[[f64; 3]], rgb: &mut [[f64; 3]]| {
            self.brdf.eval_all(incident, exitant, rgb);
        };
        let Some(out) = out else {
            let rgb = py.detach(|| fill(&pairs, all))?;
            return shaped(py, rgb.into_flattened(), pairs.shape(), Some(3));
        };
        let expected: Vec<usize> = pairs.shape().iter().copied().chain([3]).collect();
        {
            let mut writable = out
                .try_readwrite()
                .map_err(|error| PyValueError::new_err(format!("out cannot be written to: {error}")))?;
            let mut view = writable.as_array_mut();
            let Some(numbers) = view.as_slice_mut().filter(|_| out.shape() == expected) else {
                return Err(PyValueError::new_err(format!(
                    "out has the shape {:?}; allowed is {expected:?}, with rows one after the other in memory",
                    out.shape()
                )));
            };
            py.detach(|| fill_in(&pairs, numbers.as_chunks_mut().0, all))?;
        }
        Ok(out)
    }

    /// Evaluates pair by pair, as a renderer asks that has one ray at a time: what a benchmark compares `eval` with.
    ///
    /// >>> import goniod
    /// >>> grey = goniod.material("lambert:0.5")
    /// >>> bool((grey.eval_one_by_one([[0, 0, 1]], [[0, 0, 1]]) == grey.eval([[0, 0, 1]], [[0, 0, 1]])).all())
    /// True
    fn eval_one_by_one<'py>(
        &self,
        py: Python<'py>,
        incident: Numbers<'py>,
        exitant: Numbers<'py>,
    ) -> PyResult<Array<'py, f64>> {
        let pairs = Pairs::read(&incident, &exitant)?;
        let one = |incident: &[[f64; 3]], exitant: &[[f64; 3]], rgb: &mut [[f64; 3]]| {
            for ((incident, exitant), rgb) in incident.iter().zip(exitant).zip(rgb) {
                *rgb = self
                    .brdf
                    .eval(DVec3::from_array(*incident), DVec3::from_array(*exitant))
                    .to_array();
            }
        };
        let rgb = py.detach(|| fill(&pairs, one))?;
        shaped(py, rgb.into_flattened(), pairs.shape(), Some(3))
    }

    /// Tells for pairs of directions whether the answer rests on anything: false where a measured table has no entry.
    ///
    /// >>> import goniod
    /// >>> bool(goniod.material("gold-paint").valid([0, 0, 1], [0, 0, 1]))
    /// True
    fn valid<'py>(
        &self,
        py: Python<'py>,
        incident: Numbers<'py>,
        exitant: Numbers<'py>,
    ) -> PyResult<Array<'py, bool>> {
        let pairs = Pairs::read(&incident, &exitant)?;
        let valid = py.detach(|| each(&pairs, |incident, exitant| self.brdf.valid(incident, exitant)))?;
        shaped(py, valid, pairs.shape(), None)
    }

    /// Computes the directional albedo for viewers: the share of even light from all sides that they see, RGB, shape
    /// (…, 3).
    ///
    /// >>> import goniod, numpy as np
    /// >>> goniod.material("lambert:0.5").albedo(np.radians([[0.0, 0.0], [60.0, 0.0]]))[:, 0].round(3).tolist()
    /// [0.5, 0.5]
    fn albedo<'py>(&self, py: Python<'py>, exitant: Numbers<'py>) -> PyResult<Array<'py, f64>> {
        let directions = Directions::read("exitant", &exitant)?;
        let vectors = directions.checked("exitant")?;
        let rgb: Vec<[f64; 3]> = py.detach(|| {
            let theta = |v: &[f64; 3]| v[0].hypot(v[1]).atan2(v[2]);
            vectors
                .iter()
                .map(|v| pdv::albedo(&self.brdf, theta(v), AZIMUTHS).to_array())
                .collect()
        });
        shaped(py, rgb.into_flattened(), directions.shape(), Some(3))
    }

    /// Reads it as a perfect instrument would in the plane of its arms: the sensor at the zenith angle `theta_r` (rad), the
    /// light at signed deviations from the mirror direction. Rows of θ_r in rad, deviation, red, green and blue in sr⁻¹;
    /// deviations at which no light can stand are left out.
    ///
    /// >>> import goniod
    /// >>> goniod.material("lambert:0.5").read_plane(0.6, [-0.1, 0.0, 0.3]).shape
    /// (3, 5)
    fn read_plane<'py>(
        &self,
        py: Python<'py>,
        theta_r: f64,
        deviations: Vec<f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows: Vec<[f64; 5]> = deviations
            .iter()
            .filter_map(|&deviation| pdv::Observation::of(&self.brdf, theta_r, deviation))
            .map(|o| [o.theta_r, o.deviation, o.rgb.x, o.rgb.y, o.rgb.z])
            .collect();
        let count = rows.len();
        rows.into_flattened().into_pyarray(py).reshape([count, 5])
    }

    /// Writes it to a file and reads that back: the figures of what the file holds, beside the BRDF itself.
    ///
    /// `format` is one of `goniod.formats()`; without it the one to which the file's extension belongs.
    ///
    /// >>> import goniod, pathlib, tempfile
    /// >>> path = pathlib.Path(tempfile.mkdtemp()) / "grey.astm"
    /// >>> goniod.material("lambert:0.5").save(path, "astm")["median"] < 1e-6
    /// True
    /// >>> goniod.load(path).name.endswith("grey.astm")
    /// True
    #[pyo3(signature = (path, format=None, *, specimen=None))]
    fn save<'py>(
        &self,
        py: Python<'py>,
        path: PathBuf,
        format: Option<&str>,
        specimen: Option<String>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let format = match format {
            Some(name) => Format::named(name).map_err(|error| raised(&error))?,
            None => by_extension(&path)?,
        };
        let export = Export {
            brdf: self.brdf.as_ref(),
            readings: &[],
            metadata: Metadata {
                specimen: specimen.unwrap_or_else(|| self.name.clone()),
                ..Metadata::default()
            },
        };
        let exported = py
            .detach(|| format.export(&export))
            .map_err(|error| raised(&error))?;
        std::fs::write(&path, &exported.bytes)?;
        let figures = PyDict::new(py);
        figures.set_item("format", format.name)?;
        figures.set_item("bytes", exported.bytes.len())?;
        figures.set_item("male", exported.fidelity.male)?;
        figures.set_item("median", exported.fidelity.median)?;
        figures.set_item("p95", exported.fidelity.p95)?;
        Ok(figures)
    }
}

/// Places along a ring about the mirror direction at which the directional albedo looks.
const AZIMUTHS: usize = 16;

/// One answer a pair, on all cores.
pub(crate) fn each<T: Copy + Default + Send>(
    pairs: &Pairs<'_>,
    one: impl Fn(DVec3, DVec3) -> T + Sync,
) -> PyResult<Vec<T>> {
    fill(pairs, |incident, exitant, answers| {
        for ((incident, exitant), answer) in incident.iter().zip(exitant).zip(answers) {
            *answer = one(DVec3::from_array(*incident), DVec3::from_array(*exitant));
        }
    })
}

/// The only format with the extension of a path.
fn by_extension(path: &std::path::Path) -> PyResult<&'static Format> {
    let extension = path
        .extension()
        .and_then(|extension| extension.to_str())
        .unwrap_or_default();
    let mut found = FORMATS.iter().filter(|format| format.extension == extension);
    match (found.next(), found.next()) {
        (Some(format), None) => Ok(format),
        (first, _) => {
            let how_many = if first.is_some() {
                "several formats have"
            } else {
                "no format has"
            };
            let names: Vec<_> = FORMATS.iter().map(|format| format.name).collect();
            Err(PyValueError::new_err(format!(
                "{how_many} the extension \"{extension}\"; name one with format=: {}",
                names.join(", ")
            )))
        }
    }
}
