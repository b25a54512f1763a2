use std::ffi::OsString;

use foxhunt::{hunt::Event, log::LoggedBeacon, registry::Registry};
use foxhunt_cli::CommandError;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::{
    exceptions::{PyRuntimeError, PyValueError},
    prelude::*,
    types::PyList,
};

/// Runs one command of the program and returns its result as JSON.
///
/// Other Python threads go on meanwhile. Raises ValueError for wrong use or input and RuntimeError
/// for a failure, with the program's own text. The lines for standard error go into `heard`, if it
/// is given.
#[pyfunction]
#[pyo3(signature = (arguments, heard=None))]
pub fn run_json(
    py: Python<'_>,
    arguments: Vec<OsString>,
    heard: Option<&Bound<'_, PyList>>,
) -> PyResult<String> {
    let registry = Registry::builtin();
    let Some(heard) = heard else {
        return py.detach(|| foxhunt_cli::run_json(&registry, arguments)).map_err(python_error);
    };
    let (result, lines) = py.detach(|| foxhunt_cli::run_json_overheard(&registry, arguments));
    lines.into_iter().try_for_each(|line| heard.append(line))?;
    result.map_err(python_error)
}

/// The commands with their arguments, as JSON.
#[pyfunction]
pub fn commands_json() -> PyResult<String> {
    foxhunt_cli::commands_json(&Registry::builtin()).map_err(python_error)
}

/// Raises ValueError, with all kinds, unless events of this kind stand in logs.
#[pyfunction]
pub fn check_event(kind: &str) -> PyResult<()> {
    // The parser has the list.
    match serde_json::from_value::<Event>(serde_json::json!({ "event": kind })) {
        Err(error) if error.to_string().starts_with("unknown variant") => {
            let text = error.to_string().replacen("unknown variant", "no event", 1);
            Err(PyValueError::new_err(text))
        }
        _ => Ok(()),
    }
}

/// The true places of a beacon of a log at some times, East and North in metres, one a row; `None`
/// where the log has no truth. The beacon is JSON, as in the log's header.
#[pyfunction]
pub fn places_at<'py>(
    py: Python<'py>,
    beacon: &str,
    times: Vec<f64>,
) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
    let beacon: LoggedBeacon =
        serde_json::from_str(beacon).map_err(|error| PyValueError::new_err(error.to_string()))?;
    let places: Option<Vec<_>> = times.iter().map(|time| beacon.place_at(*time)).collect();
    let Some(places) = places.filter(|_| beacon.truth.is_some()) else { return Ok(None) };
    let flat = places.iter().flat_map(|place| [place.x, place.y]).collect();
    PyArray1::from_vec(py, flat).reshape([places.len(), 2]).map(Some)
}

fn python_error(error: CommandError) -> PyErr {
    match error {
        CommandError::Input(text) => PyValueError::new_err(text),
        error => PyRuntimeError::new_err(error.to_string()),
    }
}
