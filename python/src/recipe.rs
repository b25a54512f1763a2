//! Constructor calls, by which an object of the library is written out and made again.

use std::fmt;

use pyo3::{
    prelude::*,
    types::{PyDict, PyList, PyTuple, PyType},
};

/// An argument of a constructor.
#[derive(Clone, Debug)]
pub enum Argument {
    Number(f64),
    Numbers(Vec<f64>),
}

/// The call that made an object: a static method and its keywords.
#[derive(Clone, Debug)]
pub struct Recipe {
    method: &'static str,
    arguments: Vec<(&'static str, Argument)>,
}

impl Recipe {
    pub fn new(method: &'static str) -> Self {
        Self { method, arguments: Vec::new() }
    }

    pub fn with(mut self, name: &'static str, value: f64) -> Self {
        self.arguments.push((name, Argument::Number(value)));
        self
    }

    pub fn with_several(mut self, name: &'static str, values: &[f64]) -> Self {
        self.arguments.push((name, Argument::Numbers(values.to_vec())));
        self
    }

    /// Result of `__reduce__`: a function of the package, and the call as its arguments.
    pub fn reduced<'py>(&self, of: &Bound<'py, PyType>) -> PyResult<Bound<'py, PyTuple>> {
        let py = of.py();
        let keywords = PyDict::new(py);
        for (name, argument) in &self.arguments {
            match argument {
                Argument::Number(value) => keywords.set_item(name, value)?,
                Argument::Numbers(values) => keywords.set_item(name, PyList::new(py, values)?)?,
            }
        }
        let made = py.import("foxhunt.estimators")?.getattr("_made")?;
        (made, (of, self.method, keywords)).into_pyobject(py)
    }
}

impl fmt::Display for Recipe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}(", self.method)?;
        for (i, (name, argument)) in self.arguments.iter().enumerate() {
            let comma = if i > 0 { ", " } else { "" };
            match argument {
                Argument::Number(value) => write!(f, "{comma}{name}={value:?}")?,
                Argument::Numbers(values) => write!(f, "{comma}{name}={values:?}")?,
            }
        }
        f.write_str(")")
    }
}
