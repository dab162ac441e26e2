use glam::DVec3;
use numpy::{IntoPyArray, PyArrayMethods};
use pdv::Sampler;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::directions::{Array, Directions, Numbers, Pairs, shaped};
use crate::reflectance::each;

/// Draws directions of light for viewers in proportion to f cos θ_i; `goniod.Model.sampler` makes one.
///
/// >>> import goniod, numpy as np
/// >>> gold = goniod.material("gold-paint")
/// >>> planes = [gold.read_plane(t, np.linspace(-0.1, 0.5, 30)) for t in (0.4, 1.0)]
/// >>> sampler = goniod.fit(planes).sampler()
/// >>> viewers = np.tile([0.6, 0.0, 0.8], (1000, 1))
/// >>> lights, densities = sampler.sample(viewers, np.random.default_rng(1).random((1000, 2)))
/// >>> bool(np.allclose(densities, sampler.pdf(lights, viewers)))
/// True
#[pyclass(name = "Sampler", module = "goniod", frozen)]
pub(crate) struct PySampler(pub(crate) Sampler);

#[pymethods]
impl PySampler {
    /// Draws one light for each viewer and each two even numbers of 0 … below 1, shape (…, 2): unit vectors, shape (…, 3),
    /// and their densities over solid angle in sr⁻¹. Where a viewer stands at or below the horizon the density is 0.
    ///
    /// >>> import goniod
    /// >>> grey = goniod.material("lambert:0.5")
    /// >>> sampler = goniod.fit([grey.read_plane(0.5, [-0.2, 0.0, 0.3])]).sampler()
    /// >>> lights, densities = sampler.sample([0.0, 0.0, 1.0], [[0.1, 0.2], [0.7, 0.4]])
    /// >>> lights.shape, densities.shape
    /// ((2, 3), (2,))
    fn sample<'py>(
        &self,
        py: Python<'py>,
        exitant: Numbers<'py>,
        numbers: Numbers<'py>,
    ) -> PyResult<(Array<'py, f64>, Array<'py, f64>)> {
        let viewers = Directions::read("exitant", &exitant)?;
        let vectors = viewers.checked("exitant")?;
        let drawn: Vec<f64> = numbers.as_array().iter().copied().collect();
        let numbers_shape = numbers.as_array().shape().to_vec();
        let (two, shape) = match numbers_shape.split_last() {
            Some((2, shape)) if viewers.shape().is_empty() || viewers.shape() == shape => {
                (drawn.as_chunks::<2>().0, shape)
            }
            _ => {
                return Err(PyValueError::new_err(format!(
                    "numbers has the shape {numbers_shape:?}; allowed is (…, 2) with one pair for each of the viewers, {:?}",
                    viewers.shape()
                )));
            }
        };
        if let Some(at) = two
            .iter()
            .position(|pair| !pair.iter().all(|n| (0.0..1.0).contains(n)))
        {
            return Err(PyValueError::new_err(format!(
                "numbers number {at} is {:?}; allowed are 0 … below 1",
                two[at]
            )));
        }
        let one = |(n, &pair): (usize, &[f64; 2])| {
            let viewer = vectors[if viewers.shape().is_empty() { 0 } else { n }];
            match self.0.sample(DVec3::from_array(viewer), pair) {
                Some(sample) => (sample.incident.to_array(), sample.pdf),
                None => ([0.0, 0.0, 1.0], 0.0),
            }
        };
        let (lights, densities): (Vec<[f64; 3]>, Vec<f64>) =
            py.detach(|| two.par_iter().enumerate().with_min_len(1024).map(one).unzip());
        Ok((
            shaped(py, lights.into_flattened(), shape, Some(3))?,
            shaped(py, densities, shape, None)?,
        ))
    }

    /// The density over solid angle, sr⁻¹, with which `sample` draws lights for viewers.
    ///
    /// >>> import goniod
    /// >>> grey = goniod.material("lambert:0.5")
    /// >>> sampler = goniod.fit([grey.read_plane(0.5, [-0.2, 0.0, 0.3])]).sampler()
    /// >>> float(sampler.pdf([0.0, 0.0, -1.0], [0.0, 0.0, 1.0]))
    /// 0.0
    fn pdf<'py>(
        &self,
        py: Python<'py>,
        incident: Numbers<'py>,
        exitant: Numbers<'py>,
    ) -> PyResult<Array<'py, f64>> {
        let pairs = Pairs::read(&incident, &exitant)?;
        let densities = py.detach(|| each(&pairs, |i, o| self.0.pdf(i, o)))?;
        shaped(py, densities, pairs.shape(), None)
    }

    /// What is drawn from, for a renderer: `shares`, the probability of each ring about the mirror direction, and Walker's
    /// alias table, `own` and `alias`; each has the shape (viewers, rings).
    ///
    /// >>> import goniod
    /// >>> grey = goniod.material("lambert:0.5")
    /// >>> rings = goniod.fit([grey.read_plane(0.5, [-0.2, 0.0, 0.3])]).sampler().rings()
    /// >>> float(rings["shares"].sum(1).min().round(6))
    /// 1.0
    fn rings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let rows = self.0.rings().len();
        let (mut shares, mut own, mut alias) = (Vec::new(), Vec::new(), Vec::new());
        for rings in self.0.rings() {
            shares.extend_from_slice(rings.shares);
            own.extend(rings.aliases.iter().map(|&(own, _)| own));
            alias.extend(rings.aliases.iter().map(|&(_, alias)| u32::from(alias)));
        }
        let columns = shares.len() / rows;
        let found = PyDict::new(py);
        found.set_item("shares", shares.into_pyarray(py).reshape([rows, columns])?)?;
        found.set_item("own", own.into_pyarray(py).reshape([rows, columns])?)?;
        found.set_item("alias", alias.into_pyarray(py).reshape([rows, columns])?)?;
        Ok(found)
    }
}
