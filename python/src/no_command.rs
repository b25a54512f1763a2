use std::ffi::OsString;

use pyo3::{exceptions::PyImportError, prelude::*, types::PyList};

/// Raises ImportError: this installation holds estimators alone.
#[pyfunction]
#[pyo3(signature = (_arguments, _heard=None))]
pub fn run_json(_arguments: Vec<OsString>, _heard: Option<&Bound<'_, PyList>>) -> PyResult<String> {
    Err(no_program())
}

/// Raises ImportError: this installation holds estimators alone.
#[pyfunction]
pub fn commands_json() -> PyResult<String> {
    Err(no_program())
}

/// Raises ImportError: this installation holds estimators alone.
#[pyfunction]
pub fn check_event(_kind: &str) -> PyResult<()> {
    Err(no_program())
}

/// Raises ImportError: this installation holds estimators alone.
#[pyfunction]
pub fn places_at(_beacon: &str, _times: Vec<f64>) -> PyResult<()> {
    Err(no_program())
}

fn no_program() -> PyErr {
    PyImportError::new_err(
        "this installation of foxhunt holds the estimators alone, without the program's commands \
         and logs; install it without --no-default-features for these",
    )
}
