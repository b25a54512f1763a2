//! The extension module of the Python package `foxhunt`: estimators over models of Rust and of
//! Python, and the program's commands with their results as JSON.

/// Calls a function that returns `PyResult` for the sizes of a state and of a measurement.
macro_rules! of_size {
    ($n:expr, $m:expr, $function:ident $arguments:tt) => {
        of_size!($n, $m, $function $arguments, 2 3 4 5 6 7 8)
    };
    ($n:expr, $m:expr, $function:ident $arguments:tt, $($size:literal)+) => {
        match ($n, $m) {
            $(
                ($size, 1) => $function::<$size, 1> $arguments,
                ($size, 2) => $function::<$size, 2> $arguments,
                ($size, 3) => $function::<$size, 3> $arguments,
            )+
            (n, m) => Err(pyo3::exceptions::PyValueError::new_err(format!(
                "the state has {n} and the measurement {m} components; \
                 there must be 2 to 8, and 1 to 3"
            ))),
        }
    };
}

mod arrays;
#[cfg(feature = "program")]
mod command;
#[cfg(not(feature = "program"))]
#[path = "no_command.rs"]
mod command;
mod consistency;
mod estimator;
mod failure;
mod joint;
mod laws;
mod model;
mod motion;
mod pose;
mod recipe;

use pyo3::prelude::*;

/// Module beneath the package's Python code.
#[pymodule]
mod _foxhunt {
    #[pymodule_export]
    use crate::{
        command::{check_event, commands_json, places_at, run_json},
        consistency::{judge_squares, judge_whiteness},
        estimator::{Correction, Estimate, Estimator, Innovation},
        laws::{check_estimator, check_model},
        model::Model,
        motion::Motion,
    };

    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the name that Python's modules have")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
