use pdv::Draw;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::reflectance::PyBrdf;

/// Compares an estimate with the truth by every metric, over pairs of directions that are drawn evenly in angle: the text
/// of a JSON object, as `gonioctl eval --json` prints it.
#[pyfunction(name = "compare_json")]
pub(crate) fn compare(
    py: Python<'_>,
    truth: &PyBrdf,
    estimate: &PyBrdf,
    pairs: u64,
    theta_max: f64,
    seed: u64,
) -> PyResult<String> {
    if !(theta_max > 0.0 && theta_max <= std::f64::consts::FRAC_PI_2) {
        return Err(PyValueError::new_err(format!(
            "theta_max is {theta_max}; allowed is above 0 … π/2, in rad"
        )));
    }
    let draw = Draw {
        pairs,
        theta_max,
        seed,
    };
    let comparison = py.detach(|| pdv::compare(&truth.brdf, &[&estimate.brdf], &draw));
    Ok(serde_json::to_string(&comparison[0]).expect("a comparison is numbers under names"))
}

/// Compares pictures of lit spheres of both: the text of a JSON object.
#[pyfunction(name = "spheres_json")]
pub(crate) fn spheres(py: Python<'_>, truth: &PyBrdf, estimate: &PyBrdf) -> String {
    let found = py.detach(|| pdv::metric::spheres(&truth.brdf, &[&estimate.brdf]));
    serde_json::to_string(&found[0]).expect("two numbers under names")
}
