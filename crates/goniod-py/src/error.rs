use std::error::Error;
use std::fmt::Write as _;

use pyo3::PyErr;
use pyo3::exceptions::{PyOSError, PyValueError};

/// What a library says, with all causes in one sentence, as a `ValueError`, or as an `OSError` where the medium refused.
pub(crate) fn raised(error: &(dyn Error + 'static)) -> PyErr {
    let mut text = error.to_string();
    let mut medium = error.is::<std::io::Error>();
    let mut cause = error.source();
    while let Some(inner) = cause {
        // A String takes whatever is written to it.
        let _ = write!(text, ": {inner}");
        medium |= inner.is::<std::io::Error>();
        cause = inner.source();
    }
    match medium {
        true => PyOSError::new_err(text),
        false => PyValueError::new_err(text),
    }
}
