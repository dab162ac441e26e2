use std::sync::Arc;

use numpy::{IntoPyArray, PyArrayMethods, PyReadonlyArray2};
use pdv::{Auto, Basis, Bivariate, Model, Observation, Planes, Separable, Within};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::directions::{Array, Numbers, Pairs, shaped};
use crate::error::raised;
use crate::reflectance::{PyBrdf, each};
use crate::sampler::PySampler;

/// A BRDF that was made of the readings of a few sweeps; `goniod.fit` and `goniod.Run.model` make one.
///
/// >>> import goniod
/// >>> grey = goniod.material("lambert:0.5")
/// >>> model = goniod.fit([grey.read_plane(0.5, [-0.2, 0.0, 0.3])])
/// >>> isinstance(model, goniod.Brdf)
/// True
#[pyclass(name = "Model", module = "goniod", extends = PyBrdf, frozen)]
pub(crate) struct PyModel {
    model: Arc<dyn Model>,
    planes: Option<Arc<Planes>>,
}

#[pymethods]
impl PyModel {
    /// What it is and how it was made, in words.
    ///
    /// >>> import goniod
    /// >>> grey = goniod.material("lambert:0.5")
    /// >>> goniod.fit([grey.read_plane(0.5, [-0.2, 0.0, 0.3])]).about[:20]
    /// 'the reciprocal model'
    #[getter]
    fn about(&self) -> String {
        self.model.about()
    }

    /// Tells for pairs of directions whether the answer rests on nothing that was measured.
    ///
    /// >>> import goniod, numpy as np
    /// >>> grey = goniod.material("lambert:0.5")
    /// >>> model = goniod.fit([grey.read_plane(0.5, [-0.2, 0.0, 0.3])])
    /// >>> model.extrapolated([[0.5, np.pi], [1.4, 0.0]], [0.5, 0.0]).tolist()
    /// [False, True]
    fn extrapolated<'py>(
        &self,
        py: Python<'py>,
        incident: Numbers<'py>,
        exitant: Numbers<'py>,
    ) -> PyResult<Array<'py, bool>> {
        let pairs = Pairs::read(&incident, &exitant)?;
        let extrapolated = |i, o| self.model.basis(i, o) != Basis::Interpolated;
        let answers = py.detach(|| each(&pairs, extrapolated))?;
        shaped(py, answers, pairs.shape(), None)
    }

    /// The one-dimensional factors: name, name of the variable with its unit, and rows of the variable, red, green and
    /// blue.
    ///
    /// >>> import goniod
    /// >>> grey = goniod.material("lambert:0.5")
    /// >>> [(f.name, f.variable) for f in goniod.fit([grey.read_plane(0.5, [-0.2, 0.0, 0.3])]).factors()][0]
    /// ('F', 'theta_d_deg')
    fn factors(&self, py: Python<'_>) -> PyResult<Vec<PyFactor>> {
        let tables = self.model.factors().into_iter();
        tables
            .map(|table| {
                let rows: Vec<[f64; 4]> = table
                    .rows
                    .iter()
                    .map(|(x, rgb)| [*x, rgb.x, rgb.y, rgb.z])
                    .collect();
                let count = rows.len();
                Ok(PyFactor {
                    name: table.name,
                    variable: table.variable,
                    rows: rows
                        .into_flattened()
                        .into_pyarray(py)
                        .reshape([count, 4])?
                        .into_any()
                        .unbind(),
                })
            })
            .collect()
    }

    /// What draws directions of light in proportion to f cos θ_i.
    ///
    /// >>> import goniod
    /// >>> grey = goniod.material("lambert:0.5")
    /// >>> sampler = goniod.fit([grey.read_plane(0.5, [-0.2, 0.0, 0.3])]).sampler()
    /// >>> light, density = sampler.sample([0.0, 0.0, 1.0], [0.5, 0.5])
    /// >>> bool(density > 0.0)
    /// True
    fn sampler(&self, py: Python<'_>) -> PySampler {
        PySampler(py.detach(|| pdv::Sampler::new(self.model.as_ref())))
    }

    /// The numbers of the small table that the model evaluates, for a renderer: `logs` is log₂ f, shape (rows, columns, 3),
    /// in float32; `inverse` and `cells` make a column of a half angle, and `light` says which channels are not black.
    ///
    /// >>> import goniod
    /// >>> grey = goniod.material("lambert:0.5")
    /// >>> goniod.fit([grey.read_plane(0.5, [-0.2, 0.0, 0.3])]).table()["logs"].shape
    /// (20, 66, 3)
    fn table<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let planes = self.planes.as_ref().ok_or_else(|| {
            PyValueError::new_err(
                "this model has no such table; allowed are the models \"planes\" and \"reciprocal\", and \"auto\" where it \
                 chose \"planes\"",
            )
        })?;
        let table = planes.plain_table();
        let found = PyDict::new(py);
        let logs = table.logs.to_vec().into_pyarray(py);
        found.set_item("logs", logs.reshape([table.rows, table.columns, 3])?)?;
        found.set_item("inverse", table.inverse)?;
        found.set_item("cells", table.cells)?;
        found.set_item("light", table.light.to_vec())?;
        Ok(found)
    }
}

/// A one-dimensional factor of a model as a table.
///
/// >>> import goniod
/// >>> grey = goniod.material("lambert:0.5")
/// >>> goniod.fit([grey.read_plane(0.5, [-0.2, 0.0, 0.3])]).factors()[0].rows.shape[1]
/// 4
#[pyclass(name = "Factor", module = "goniod", frozen)]
pub(crate) struct PyFactor {
    /// Its name: "F" or "G".
    #[pyo3(get)]
    name: &'static str,
    /// The name of its variable, with the unit.
    #[pyo3(get)]
    variable: &'static str,
    /// The variable, red, green and blue, shape (N, 4).
    #[pyo3(get)]
    rows: Py<PyAny>,
}

/// Makes a model of observations: rows of θ_r in rad, signed deviation, red, green and blue in sr⁻¹. `kind` is the name of
/// a model; with the text of a job its scene holds.
#[pyfunction]
pub(crate) fn fit_rows(
    py: Python<'_>,
    planes: Vec<PyReadonlyArray2<'_, f64>>,
    arc: PyReadonlyArray2<'_, f64>,
    kind: &str,
    job: Option<&str>,
    name: String,
) -> PyResult<Py<PyModel>> {
    let planes = planes.iter().map(observations).collect::<PyResult<Vec<_>>>()?;
    let arc = observations(&arc)?;
    let scene = job.map(scene).transpose()?.flatten();
    let made = py.detach(|| made(kind, &planes, &arc))?;
    let (model, table) = made.map_err(|error| raised(&error))?;
    let model: Arc<dyn Model> = match scene {
        Some(scene) => Arc::new(Within::new(model, scene)),
        None => Arc::from(model),
    };
    let brdf = PyBrdf::new(model.clone(), name);
    let model = PyModel {
        model,
        planes: table.map(Arc::new),
    };
    Py::new(py, PyClassInitializer::from(brdf).add_subclass(model))
}

/// The name of the model that a job file asks for.
#[pyfunction]
pub(crate) fn model_of_job(job: &str) -> PyResult<&'static str> {
    let job = sweep::Job::parse(job, "job file").map_err(|error| raised(&error))?;
    Ok(job.model.name())
}

type Made = Result<(Box<dyn Model>, Option<Planes>), pdv::Error>;

/// The model of a name, and the same with its table, where it has one.
fn made(kind: &str, planes: &[Vec<Observation>], arc: &[Observation]) -> PyResult<Made> {
    let first = &planes[..planes.len().min(1)];
    let of_planes = |planes: &[Vec<Observation>]| -> Made {
        let model = Planes::from_observations(planes, arc)?;
        Ok((Box::new(model.clone()), Some(model)))
    };
    Ok(match kind {
        "planes" => of_planes(planes),
        "reciprocal" => of_planes(first),
        "bivariate" => Bivariate::from_observations(planes, arc).map(|model| (Box::new(model) as _, None)),
        "separable" => {
            let plane = first.first().map(Vec::as_slice).unwrap_or_default();
            Separable::from_observations(plane, arc).map(|model| (Box::new(model) as _, None))
        }
        "auto" => match Auto::from_observations(planes, arc) {
            Ok(auto) if auto.chosen() == "planes" => of_planes(planes),
            auto => auto.map(|auto| (Box::new(auto) as _, None)),
        },
        _ => {
            return Err(PyValueError::new_err(format!(
                "there is no model \"{kind}\"; there are planes, reciprocal, bivariate, separable and auto"
            )));
        }
    })
}

/// The scene that a job names.
fn scene(job: &str) -> PyResult<Option<pdv::Scene>> {
    let job = sweep::Job::parse(job, "job file").map_err(|error| raised(&error))?;
    Ok(job.scene)
}

fn observations(rows: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Observation>> {
    let rows = rows.as_array();
    if rows.ncols() != 5 {
        return Err(PyValueError::new_err(format!(
            "a sweep has the shape {:?}; allowed is (N, 5): θ_r in rad, deviation, red, green and blue in 1/sr",
            rows.shape()
        )));
    }
    let observation = |row: numpy::ndarray::ArrayView1<'_, f64>| Observation {
        theta_r: row[0],
        deviation: row[1],
        rgb: glam::DVec3::new(row[2], row[3], row[4]),
    };
    Ok(rows.rows().into_iter().map(observation).collect())
}
