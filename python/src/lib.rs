//! The extension module of the Python package `foxhunt`: estimators over models of Rust and of
//! Python, and the program's commands with their results as JSON.

mod arrays;
mod command;
mod consistency;
mod estimator;
mod failure;
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
        command::{commands_json, places_at, run_json},
        consistency::{judge_squares, judge_whiteness},
        estimator::{Correction, Estimate, Estimator},
        model::Model,
        motion::Motion,
    };

    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the name that Python's modules have")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
