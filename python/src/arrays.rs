//! Arrays of Python as vectors and matrices of known size.

use foxhunt::nalgebra::{SMatrix, SVector};
use numpy::{AllowTypeChange, PyArrayLike1, PyArrayLike2, PyUntypedArrayMethods};
use pyo3::{exceptions::PyValueError, prelude::*};

/// A vector that Python gives as anything that NumPy makes an array of; `name` is for the error.
pub(crate) fn vector<const D: usize>(
    value: &Bound<'_, PyAny>,
    name: &str,
) -> PyResult<SVector<f64, D>> {
    let array: PyArrayLike1<'_, f64, AllowTypeChange> =
        value.extract().map_err(|_| wrong(name, &format!("{D} numbers"), value))?;
    let array = array.as_array();
    if array.len() != D {
        return Err(wrong(name, &format!("{D} numbers"), value));
    }
    Ok(SVector::from_iterator(array.iter().copied()))
}

/// A square matrix, as [`vector`].
pub(crate) fn matrix<const D: usize>(
    value: &Bound<'_, PyAny>,
    name: &str,
) -> PyResult<SMatrix<f64, D, D>> {
    let array: PyArrayLike2<'_, f64, AllowTypeChange> =
        value.extract().map_err(|_| wrong(name, &format!("{D} rows of {D} numbers"), value))?;
    if array.shape() != [D, D] {
        return Err(wrong(name, &format!("{D} rows of {D} numbers"), value));
    }
    Ok(SMatrix::from_row_iterator(array.as_array().iter().copied()))
}

/// Returns the number of a vector's components.
pub(crate) fn length(value: &Bound<'_, PyAny>, name: &str) -> PyResult<usize> {
    value.len().map_err(|_| wrong(name, "a sequence of numbers", value))
}

fn wrong(name: &str, requirement: &str, value: &Bound<'_, PyAny>) -> PyErr {
    PyValueError::new_err(format!("{name} is {value}; it must be {requirement}"))
}
