//! Tests of consistency, over what runs have left.

use foxhunt::{
    filters::consistency::{ChiSquaredAverage, Whiteness},
    nalgebra::SVector,
};
use numpy::{AllowTypeChange, PyArrayLike2, PyUntypedArrayMethods};
use pyo3::{exceptions::PyValueError, prelude::*};

use crate::failure::value_error;

/// Average, expected average, interval and verdict.
type Judged = (f64, f64, (f64, f64), String);

/// Judges normalised squares, each with its degrees of freedom.
#[pyfunction]
pub fn judge_squares(
    squares: Vec<f64>,
    degrees_of_freedom: Vec<usize>,
    probability: f64,
) -> PyResult<Judged> {
    if squares.len() != degrees_of_freedom.len() {
        return Err(PyValueError::new_err(format!(
            "there are {} squares and {} degrees of freedom; there must be as many",
            squares.len(),
            degrees_of_freedom.len()
        )));
    }
    let mut average = ChiSquaredAverage::new(probability).map_err(value_error)?;
    average.extend(squares.into_iter().zip(degrees_of_freedom));
    let found = average.average().zip(average.expected()).zip(average.interval());
    let Some(((mean, expected), [low, high])) = found else {
        return Err(PyValueError::new_err("there is no square with a degree of freedom"));
    };
    Ok((mean, expected, (low, high), average.verdict().to_string()))
}

/// Statistic, lags and p-value of all lags; ρ and its σ at each lag.
type White = (f64, usize, f64, Vec<(usize, f64, f64)>);

/// Judges runs of normalised innovations, one a row; NaN stands for a missing component.
#[pyfunction]
pub fn judge_whiteness(
    runs: Vec<PyArrayLike2<'_, f64, AllowTypeChange>>,
    lags: usize,
) -> PyResult<White> {
    let mut whiteness = Whiteness::new(lags);
    for run in &runs {
        match run.shape()[1] {
            1 => add::<1>(&mut whiteness, run),
            2 => add::<2>(&mut whiteness, run),
            3 => add::<3>(&mut whiteness, run),
            4 => add::<4>(&mut whiteness, run),
            columns => {
                let text = format!("innovations have {columns} components; there must be 1 to 4");
                return Err(PyValueError::new_err(text));
            }
        }
    }
    let test = whiteness.ljung_box();
    let test = test.ok_or_else(|| PyValueError::new_err("no lag has a pair of innovations"))?;
    let each = whiteness.autocorrelations().map(|each| (each.lag, each.rho, each.sigma));
    Ok((test.statistic, test.lags, test.p_value, each.collect()))
}

fn add<const M: usize>(whiteness: &mut Whiteness, run: &PyArrayLike2<'_, f64, AllowTypeChange>) {
    let run = run.as_array();
    let rows = run
        .rows()
        .into_iter()
        .map(|row| SVector::from_fn(|i, _| Some(row[i]).filter(|value| !value.is_nan())));
    whiteness.add_run::<M>(&rows.collect::<Vec<_>>());
}
