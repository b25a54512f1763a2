//! Arrays of Python as vectors and matrices of known size.

use foxhunt::nalgebra::{DMatrix, DVector, SMatrix, SVector};
use numpy::{
    AllowTypeChange, PyArray1, PyArrayLike1, PyArrayLike2, PyArrayLike3, PyArrayMethods,
    PyUntypedArrayMethods,
};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyFloat, PyInt, PyList, PyTuple},
};

/// A vector that Python gives as anything that NumPy makes an array of; `name` is for the error.
pub fn vector<const D: usize>(value: &Bound<'_, PyAny>, name: &str) -> PyResult<SVector<f64, D>> {
    if D == 1
        && let Some(one) = number(value)
    {
        return Ok(SVector::repeat(one));
    }
    let array: PyArrayLike1<'_, f64, AllowTypeChange> =
        value.extract().map_err(|_| wrong(name, &format!("{D} numbers"), value))?;
    let array = array.as_array();
    if array.len() != D {
        return Err(wrong(name, &format!("{D} numbers"), value));
    }
    Ok(SVector::from_iterator(array.iter().copied()))
}

/// A number by itself, which is no array of one.
pub fn number(value: &Bound<'_, PyAny>) -> Option<f64> {
    let single = value.is_instance_of::<PyFloat>() || value.is_instance_of::<PyInt>();
    // NumPy makes a number of an array of one, but warns.
    if single || value.len().is_err() { value.extract().ok() } else { None }
}

/// A matrix, as [`vector`].
pub fn matrix<const R: usize, const C: usize>(
    value: &Bound<'_, PyAny>,
    name: &str,
) -> PyResult<SMatrix<f64, R, C>> {
    let array: PyArrayLike2<'_, f64, AllowTypeChange> =
        value.extract().map_err(|_| wrong(name, &format!("{R} rows of {C} numbers"), value))?;
    if array.shape() != [R, C] {
        return Err(wrong(name, &format!("{R} rows of {C} numbers"), value));
    }
    Ok(SMatrix::from_row_iterator(array.as_array().iter().copied()))
}

/// A covariance, or that of standard deviations, as [`vector`]; one number is the standard
/// deviation of a single component.
pub fn covariance<const D: usize>(
    value: &Bound<'_, PyAny>,
    name: &str,
) -> PyResult<SMatrix<f64, D, D>> {
    match vector::<D>(value, name) {
        Ok(sigma) if sigma.iter().any(|sigma| *sigma < 0.0) => {
            Err(wrong(name, "standard deviations that are not negative", value))
        }
        Ok(sigma) => Ok(SMatrix::from_diagonal(&sigma.component_mul(&sigma))),
        Err(_) => matrix(value, name).map_err(|_| {
            let requirement = format!("{D} standard deviations, or {D} rows of {D} numbers");
            wrong(name, &requirement, value)
        }),
    }
}

/// `count` numbers, as [`vector`].
pub fn as_many(value: &Bound<'_, PyAny>, count: usize, name: &str) -> PyResult<DVector<f64>> {
    let all = match number(value) {
        Some(one) => vec![one],
        None => numbers(value, name)?,
    };
    if all.len() != count {
        return Err(wrong(name, &format!("{count} numbers"), value));
    }
    Ok(all.into())
}

/// A matrix of `rows` by `columns`, as [`matrix`].
pub fn of_shape(
    value: &Bound<'_, PyAny>,
    rows: usize,
    columns: usize,
    name: &str,
) -> PyResult<DMatrix<f64>> {
    let requirement = || format!("{rows} rows of {columns} numbers");
    let array: PyArrayLike2<'_, f64, AllowTypeChange> =
        value.extract().map_err(|_| wrong(name, &requirement(), value))?;
    if array.shape() != [rows, columns] {
        return Err(wrong(name, &requirement(), value));
    }
    Ok(DMatrix::from_row_iterator(rows, columns, array.as_array().iter().copied()))
}

/// A square matrix, as [`of_shape`].
pub fn square(value: &Bound<'_, PyAny>, size: usize, name: &str) -> PyResult<DMatrix<f64>> {
    of_shape(value, size, size, name)
}

/// Numbers of any count, as [`vector`].
pub fn numbers(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<f64>> {
    if value.is_exact_instance_of::<PyTuple>() || value.is_exact_instance_of::<PyList>() {
        return value.extract().map_err(|_| wrong(name, "numbers", value));
    }
    let array: PyArrayLike1<'_, f64, AllowTypeChange> =
        value.extract().map_err(|_| wrong(name, "numbers", value))?;
    Ok(array.as_array().to_vec())
}

/// States in columns as an array with one state a row, of which each column is contiguous.
pub fn states<'py, const N: usize>(
    py: Python<'py>,
    columns: [&[f64]; N],
) -> PyResult<Bound<'py, PyAny>> {
    let count = columns.first().map_or(0, |column| column.len());
    let flat = PyArray1::from_vec(py, columns.concat());
    flat.reshape([N, count])?.call_method0("transpose")
}

/// The rows that a vectorised function of Python returns for `count` states: `count` × D numbers,
/// or as many in one column where D is 1.
pub fn rows<const D: usize>(
    value: &Bound<'_, PyAny>,
    count: usize,
    name: &str,
) -> PyResult<Vec<SVector<f64, D>>> {
    let requirement = || format!("{count} rows of {D} numbers, one row for each state");
    if D == 1
        && let Ok(array) = value.extract::<PyArrayLike1<'_, f64, AllowTypeChange>>()
        && array.len() == count
    {
        return Ok(array.as_array().iter().map(|value| SVector::repeat(*value)).collect());
    }
    let array: PyArrayLike2<'_, f64, AllowTypeChange> =
        value.extract().map_err(|_| wrong(name, &requirement(), value))?;
    if array.shape() != [count, D] {
        return Err(wrong(name, &requirement(), value));
    }
    let array = array.as_array();
    Ok(array.rows().into_iter().map(|row| SVector::from_fn(|i, _| row[i])).collect())
}

/// The matrices that a vectorised function of Python returns for `count` states: one for all, or
/// one for each.
pub fn matrices<const D: usize>(
    value: &Bound<'_, PyAny>,
    count: usize,
    name: &str,
) -> PyResult<Vec<SMatrix<f64, D, D>>> {
    if let Ok(one) = matrix(value, name) {
        return Ok(vec![one]);
    }
    let requirement = || format!("{D} rows of {D} numbers, for all states or each of {count}");
    let array: PyArrayLike3<'_, f64, AllowTypeChange> =
        value.extract().map_err(|_| wrong(name, &requirement(), value))?;
    if array.shape() != [count, D, D] {
        return Err(wrong(name, &requirement(), value));
    }
    let array = array.as_array();
    let each = array.outer_iter().map(|matrix| SMatrix::from_fn(|i, j| matrix[[i, j]]));
    Ok(each.collect())
}

/// True if an object of Python takes many states at once.
pub fn is_vectorized(object: &Bound<'_, PyAny>) -> PyResult<bool> {
    if !object.hasattr("vectorized")? {
        return Ok(false);
    }
    object.getattr("vectorized")?.is_truthy()
}

/// Returns the number of a vector's components.
pub fn length(value: &Bound<'_, PyAny>, name: &str) -> PyResult<usize> {
    value.len().map_err(|_| wrong(name, "a sequence of numbers", value))
}

fn wrong(name: &str, requirement: &str, value: &Bound<'_, PyAny>) -> PyErr {
    PyValueError::new_err(format!("{name} is {value}; it must be {requirement}"))
}
