//! The laws of the library, for estimators and measurement models that are written in Python.

use std::{
    any::type_name,
    cell::Cell,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind, set_hook, take_hook},
    sync::Once,
};

use foxhunt::core::{
    Correction, Estimate, Estimator, EstimatorError, Observation, Pose, Quantity, State,
    laws::{self, Checks, Predictive},
};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::{
    conversion::FromPyObjectOwned,
    exceptions::{PyAssertionError, PyValueError},
    prelude::*,
    types::PyDict,
};

use crate::{
    arrays,
    failure::{Failure, value_error},
    model::{components, model, quantities},
    pose::{self, pose},
};

/// The observation at which laws are checked, as Python gives it.
struct Given<'a, 'py> {
    value: &'a Bound<'py, PyAny>,
    noise: &'a Bound<'py, PyAny>,
    receiver: Pose,
}

impl Given<'_, '_> {
    fn observation<const M: usize>(&self) -> PyResult<Observation<M>> {
        let value = arrays::vector(self.value, "value")?;
        let noise = arrays::covariance(self.noise, "noise")?;
        Observation::new(0.0, self.receiver, value, noise).map_err(value_error)
    }
}

/// Checks an estimator: `make` returns a new one each time. Raises AssertionError for a breach.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "Python's are named")]
pub fn check_estimator(
    make: &Bound<'_, PyAny>,
    pairs: &Bound<'_, PyAny>,
    value: &Bound<'_, PyAny>,
    noise: &Bound<'_, PyAny>,
    receiver: Option<&Bound<'_, PyAny>>,
    heading: Option<f64>,
    velocity: Option<&Bound<'_, PyAny>>,
    step: f64,
    worthless_tolerance: Option<f64>,
    predictive: Option<(f64, f64, bool)>,
) -> PyResult<()> {
    let given = Given { value, noise, receiver: pose(receiver, heading, velocity)? };
    let predictive = predictive.map(|(tolerance, standard_errors, nis)| Predictive {
        tolerance,
        standard_errors,
        nis,
        ..Predictive::default()
    });
    let checks = Checks { step, worthless_tolerance, predictive };
    let mean = make.call0()?.call_method0("estimate")?.getattr("mean")?;
    let n = arrays::length(&mean, "the mean of estimate()")?;
    of_size!(n, pairs.len()?, estimator(make, pairs, &given, checks))
}

/// Checks a measurement model at a state. Raises AssertionError for a breach.
#[pyfunction]
pub fn check_model(
    object: &Bound<'_, PyAny>,
    state: &Bound<'_, PyAny>,
    value: &Bound<'_, PyAny>,
    noise: &Bound<'_, PyAny>,
    receiver: Option<&Bound<'_, PyAny>>,
    heading: Option<f64>,
    velocity: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let given = Given { value, noise, receiver: pose(receiver, heading, velocity)? };
    let n = arrays::length(state, "state")?;
    of_size!(n, components(object)?, measurement_model(object, state, &given))
}

fn estimator<const N: usize, const M: usize>(
    make: &Bound<'_, PyAny>,
    pairs: &Bound<'_, PyAny>,
    given: &Given<'_, '_>,
    checks: Checks,
) -> PyResult<()> {
    let quantities = quantities::<M>(pairs)?;
    let observation = given.observation()?;
    let name = make.call0()?.get_type().name()?.to_string();
    let refusal = Failure::default();
    let fresh = || {
        let object = make.call0().unwrap_or_else(raise).unbind();
        PythonEstimator::<N, M> { object, quantities, refusal: refusal.clone() }
    };
    kept(|| laws::estimator_with(fresh, &observation, checks)).map_err(|breach| {
        let py = make.py();
        let text = breach.value(py).to_string();
        let own = type_name::<PythonEstimator<N, M>>();
        if !breach.is_instance_of::<PyAssertionError>(py) || !text.contains(own) {
            return breach;
        }
        let breach = PyAssertionError::new_err(text.replacen(own, &name, 1));
        if text.contains("was refused") || text.contains("no observation is possible") {
            breach.set_cause(py, refusal.take());
        }
        breach
    })
}

fn measurement_model<const N: usize, const M: usize>(
    object: &Bound<'_, PyAny>,
    state: &Bound<'_, PyAny>,
    given: &Given<'_, '_>,
) -> PyResult<()> {
    let failure = Failure::default();
    let model = model::<N, M>(object, &failure)?;
    let state = arrays::vector(state, "state")?;
    let observation = given.observation()?;
    let checked = kept(|| laws::measurement_model(&model, &state, &observation));
    failure.take().map_or(checked, Err)
}

thread_local! {
    /// True while a panic of this thread is a breach that Python is told of.
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Runs laws; their panic becomes an AssertionError, and nothing is printed.
fn kept(laws: impl FnOnce()) -> PyResult<()> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            if !QUIET.get() {
                before(panic);
            }
        }));
    });
    let quiet = QUIET.replace(true);
    let done = catch_unwind(AssertUnwindSafe(laws));
    QUIET.set(quiet);
    done.map_err(|panic| match panic.downcast::<PyErr>() {
        Ok(error) => *error,
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
            PyAssertionError::new_err(text.unwrap_or("a law was broken").to_owned())
        }
    })
}

/// Ends the laws with an exception of Python.
fn raise<T>(error: PyErr) -> T {
    resume_unwind(Box::new(error))
}

/// An object of Python with `predict`, `update` and `estimate`, and perhaps `samples`.
struct PythonEstimator<const N: usize, const M: usize> {
    object: Py<PyAny>,
    quantities: [Quantity; M],
    /// The first ValueError for a step that is valid.
    refusal: Failure,
}

impl<const N: usize, const M: usize> PythonEstimator<N, M> {
    /// Result of a call; `None` if the object refused it with ValueError.
    fn call<T>(&self, call: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>) -> Option<T> {
        Python::attach(|py| match call(self.object.bind(py)) {
            Err(error) if error.is_instance_of::<PyValueError>(py) => {
                self.refusal.keep(error);
                None
            }
            called => Some(called.unwrap_or_else(raise)),
        })
    }
}

/// An optional attribute; `None` also where it is Python's.
fn optional<'py, T>(object: &Bound<'py, PyAny>, name: &str) -> PyResult<Option<T>>
where
    T: FromPyObjectOwned<'py>,
{
    let value = object.getattr_opt(name)?.filter(|value| !value.is_none());
    value.map(|value| value.extract().map_err(Into::into)).transpose()
}

impl<const N: usize, const M: usize> Estimator<N, M> for PythonEstimator<N, M> {
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        let called = self.call(|object| object.call_method1("predict", (dt,)).map(drop));
        if EstimatorError::check_time_step(dt).is_err() {
            // As it should be: no reason for a breach.
            self.refusal.take();
        }
        called.ok_or(EstimatorError::TimeStep { dt })
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        let corrected = self.call(|object| {
            let py = object.py();
            let number = |i: usize| observation.has(i).then(|| observation.value()[i]);
            let value: Vec<Option<f64>> = (0..M).map(number).collect();
            let noise = PyArray1::from_slice(py, observation.noise().as_slice());
            let keywords = PyDict::new(py);
            // A filter whose receiver stays at the origin need not know of any.
            if *observation.receiver() != Pose::default() {
                keywords.set_item("receiver", pose::to_python(py, observation.receiver())?)?;
            }
            let arguments = (value, noise.reshape([M, M])?);
            let made = object.call_method("update", arguments, Some(&keywords))?;
            let nis = optional(&made, "nis")?;
            if optional(&made, "rejected")?.unwrap_or(false) {
                let nis = nis.unwrap_or(f64::NAN);
                return Ok(Correction::Rejected { nis, limit: nis });
            }
            let effective_sample_size = optional(&made, "effective_sample_size")?;
            Ok(match optional(&made, "log_evidence")? {
                Some(log_evidence) => {
                    Correction::Fused { nis, log_evidence, effective_sample_size }
                }
                None => Correction::Empty,
            })
        });
        corrected.ok_or(EstimatorError::Unsupported { what: "the update" })
    }

    fn estimate(&self) -> Estimate<N> {
        Python::attach(|py| {
            let made = self.object.bind(py).call_method0("estimate")?;
            let mean = arrays::vector(&made.getattr("mean")?, "the mean of estimate()")?;
            let covariance = made.getattr("covariance")?;
            let covariance = arrays::matrix(&covariance, "the covariance of estimate()")?;
            Ok(Estimate { mean, covariance })
        })
        .unwrap_or_else(raise)
    }

    fn quantities(&self) -> [Quantity; M] {
        self.quantities
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        let samples = Python::attach(|py| {
            let object = self.object.bind(py);
            let Some(samples) = object.getattr_opt("samples")? else { return Ok(None) };
            let samples = samples.call0()?;
            let weights = arrays::numbers(&samples.get_item(1)?, "the weights of samples()")?;
            let states = &samples.get_item(0)?;
            Ok(Some((arrays::rows(states, weights.len(), "the states of samples()")?, weights)))
        });
        match samples.unwrap_or_else(raise) {
            Some((states, weights)) => {
                states.iter().zip(weights).for_each(|(state, weight)| visit(state, weight));
            }
            None => foxhunt::core::visit_cubature_points(&self.estimate(), visit),
        }
    }
}
