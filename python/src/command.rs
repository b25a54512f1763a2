use std::ffi::OsString;

use foxhunt::registry::Registry;
use foxhunt_cli::CommandError;
use pyo3::{
    exceptions::{PyRuntimeError, PyValueError},
    prelude::*,
};

/// Runs one command of the program and returns its result as JSON.
///
/// Other Python threads go on meanwhile. Raises ValueError for wrong use or input and RuntimeError
/// for a failure, with the program's own text.
#[pyfunction]
pub(crate) fn run_json(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<String> {
    let result = py.detach(|| foxhunt_cli::run_json(&Registry::builtin(), arguments));
    result.map_err(|error| match error {
        CommandError::Input(text) => PyValueError::new_err(text),
        error => PyRuntimeError::new_err(error.to_string()),
    })
}
