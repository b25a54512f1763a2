//! Estimators of states and measurements whose size is known at run time only.

use std::any::Any;

use foxhunt::{
    core::{
        self, DynamicEstimate, DynamicMeasurement, DynamicMotion, DynamicObservation, Estimate,
        Pose, Quantity,
    },
    filters::{Cubature, DynamicKalman, DynamicTransform, Gate, Taylor, Unscented},
    nalgebra::{DMatrix, DVector},
};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::{exceptions::PyValueError, prelude::*};

use crate::{
    arrays,
    estimator::{self, Innovated, Parts, Prior, Samples, Settings, Steps, Update},
    failure::{Failure, value_error},
    model::{self, AnyDynamicModel, Receivers},
    motion,
};

/// A Kalman filter of any size, with its model.
#[derive(Clone)]
struct Joint<T> {
    filter: DynamicKalman<T>,
    model: AnyDynamicModel,
}

/// The Kalman filter of a kind for a state of `n` and measurements of `m` components.
pub fn joint(
    n: usize,
    m: usize,
    settings: &Settings<'_>,
    parts: &Parts<'_, '_>,
) -> PyResult<Box<dyn Steps>> {
    let Settings { kind, gate, iterations, alpha, beta, kappa, .. } = *settings;
    if !["ekf", "ckf", "ukf"].contains(&kind) {
        return Err(PyValueError::new_err(format!(
            "the state has {n} and the measurement {m} components; for {kind} there must be 2 to \
             8, and 1 to 3 (ekf, ukf and ckf take any number)"
        )));
    }
    if iterations != 1 {
        return Err(PyValueError::new_err(format!(
            "iterations is {iterations}; it must be 1 for a state of more than 8 components or a \
             measurement of more than 3"
        )));
    }
    let motion = motion::dynamic(parts.motion, n, parts.failure)?;
    let model = model::dynamic(parts.model, n, parts.failure)?;
    let prior = DynamicEstimate {
        mean: arrays::numbers(parts.mean, "mean")?.into(),
        covariance: arrays::square(parts.covariance, n, "covariance")?,
    };
    let gate = gate.map(Gate::probability).transpose().map_err(value_error)?;
    let gate = gate.unwrap_or_else(Gate::open);
    match kind {
        "ekf" => of(DynamicKalman::<Taylor>::new(motion, prior), gate, model),
        "ckf" => of(DynamicKalman::<Cubature>::new(motion, prior), gate, model),
        _ => {
            let transform = Unscented::new(alpha, beta, kappa).map_err(value_error)?;
            let filter = DynamicKalman::<Unscented>::new(motion, prior);
            of(filter.and_then(|filter| filter.with_transform(transform)), gate, model)
        }
    }
}

fn of<T>(
    filter: Result<DynamicKalman<T>, core::EstimatorError>,
    gate: Gate,
    model: AnyDynamicModel,
) -> PyResult<Box<dyn Steps>>
where
    T: DynamicTransform + Clone + Send + Sync + 'static,
{
    let filter = filter.map_err(value_error)?.with_gate(gate);
    Ok(Box::new(Joint { filter, model }))
}

impl<T> Joint<T> {
    fn observation(&self, update: &Update) -> PyResult<DynamicObservation> {
        let Update { value, noise, receiver, time } = update;
        let size = self.model.quantities().len();
        if value.len() != size || noise.len() != size * size {
            let text = format!(
                "value has {} components and noise {} numbers; the model measures {size}",
                value.len(),
                noise.len()
            );
            return Err(PyValueError::new_err(text));
        }
        // What is missing holds no number.
        let numbers = DVector::from_iterator(size, value.iter().map(|v| v.unwrap_or(0.0)));
        let noise = DMatrix::from_row_slice(size, size, noise);
        let observation = DynamicObservation::new(*time, *receiver, numbers, noise);
        let mut observation = observation.map_err(value_error)?;
        for (component, _) in value.iter().enumerate().filter(|(_, value)| value.is_none()) {
            observation = observation.without(component);
        }
        Ok(observation)
    }
}

impl<T> Steps for Joint<T>
where
    T: DynamicTransform + Clone + Send + Sync + 'static,
{
    fn predict(&mut self, dt: f64) -> Result<(), core::EstimatorError> {
        self.filter.predict(dt)
    }

    fn noise(&self, noise: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
        let size = self.model.quantities().len();
        let noise = match arrays::as_many(noise, size, "noise") {
            Ok(sigmas) => DMatrix::from_diagonal(&sigmas.map(|sigma| sigma * sigma)),
            Err(_) => arrays::square(noise, size, "noise")?,
        };
        Ok(noise.transpose().as_slice().to_vec())
    }

    fn update(&mut self, py: Python<'_>, update: &Update) -> PyResult<core::Correction> {
        let observation = self.observation(update)?;
        let Self { filter, model } = self;
        py.detach(|| filter.update(&**model, &observation)).map_err(value_error)
    }

    fn innovation(&self, py: Python<'_>, update: &Update) -> PyResult<Option<Innovated>> {
        let observation = self.observation(update)?;
        if update.value.iter().all(Option::is_none) {
            return Ok(None);
        }
        let Self { filter, model } = self;
        let found = py.detach(|| filter.innovation(&**model, &observation)).map_err(value_error)?;
        let size = update.value.len();
        let mut whole = Innovated {
            residual: DVector::zeros(size),
            expected: DVector::zeros(size),
            covariance: DMatrix::identity(size, size),
            nis: found.nis,
        };
        let present = || (0..size).filter(|component| update.value[*component].is_some());
        for (row, at) in present().enumerate() {
            whole.residual[at] = found.residual[row];
            whole.expected[at] = found.expected[row];
            for (column, beside) in present().enumerate() {
                whole.covariance[(at, beside)] = found.covariance[(row, column)];
            }
        }
        Ok(Some(whole))
    }

    fn copied(&self) -> Box<dyn Steps> {
        Box::new(self.clone())
    }

    fn smooth(&mut self, later: &dyn Steps, _dt: f64) -> Option<PyResult<()>> {
        let _: &Self = (later as &dyn Any).downcast_ref()?;
        let text = "smoothing a state of more than 8 components is not supported";
        Some(Err(PyValueError::new_err(text)))
    }

    fn prior<'py>(
        &self,
        py: Python<'py>,
        mean: &Bound<'py, PyAny>,
        covariance: &Bound<'py, PyAny>,
    ) -> PyResult<Prior<'py>> {
        let mean = arrays::numbers(mean, "mean")?;
        let size = mean.len();
        let covariance = arrays::square(covariance, size, "covariance")?.transpose();
        let flat = PyArray1::from_slice(py, covariance.as_slice());
        Ok((PyArray1::from_vec(py, mean), flat.reshape([size, size])?))
    }

    fn estimate(&self, py: Python<'_>) -> PyResult<estimator::Estimate> {
        let DynamicEstimate { mean, covariance } = self.filter.estimate();
        // Symmetric: rows are columns.
        let flat = PyArray1::from_slice(py, covariance.as_slice());
        let covariance = flat.reshape([mean.len(), mean.len()])?;
        let mean = PyArray1::from_slice(py, mean.as_slice());
        Ok(estimator::Estimate::of(mean.unbind(), covariance.unbind()))
    }

    /// The 2n cubature points: they have the moments of the belief.
    fn samples<'py>(&self, py: Python<'py>) -> PyResult<Samples<'py>> {
        let DynamicEstimate { mean, covariance } = self.filter.estimate();
        let size = mean.len();
        let factor = covariance.clone().cholesky().ok_or_else(|| {
            PyValueError::new_err("the covariance is not positive definite any more")
        })?;
        let count = u32::try_from(size).map_err(value_error)?;
        let root = factor.l() * f64::from(count).sqrt();
        let mut states = Vec::with_capacity(2 * size * size);
        for column in root.column_iter() {
            states.extend((mean + column).iter());
            states.extend((mean - column).iter());
        }
        let weights = vec![0.5 / f64::from(count); 2 * size];
        let states = PyArray1::from_vec(py, states).reshape([2 * size, size])?;
        Ok((states, PyArray1::from_vec(py, weights)))
    }

    fn nees(&self, truth: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
        let truth = arrays::numbers(truth, "truth")?;
        let estimate = self.filter.estimate();
        if truth.len() != estimate.mean.len() {
            let text = format!(
                "truth has {} components; the state has {}",
                truth.len(),
                estimate.mean.len()
            );
            return Err(PyValueError::new_err(text));
        }
        Ok(estimate.nees(&truth.into()))
    }

    fn ellipse(&self, probability: f64) -> Option<(f64, f64, f64)> {
        let place: Estimate<2> = self.filter.estimate().at([0, 1])?;
        let ellipse = place.ellipse(probability)?;
        Some((ellipse.semi_major, ellipse.semi_minor, ellipse.orientation))
    }
}

/// A motion that is written in Python, of any size.
pub struct PythonMotion {
    /// True if the object has its own derivative; otherwise it is taken by differences.
    pub has_jacobian: bool,
    pub object: Py<PyAny>,
    pub failure: Failure,
}

impl PythonMotion {
    /// The square matrix that a method returns.
    fn matrix(&self, method: &str, state: &DVector<f64>, dt: f64) -> DMatrix<f64> {
        let size = state.len();
        let call = |py: Python<'_>| {
            let state = PyArray1::from_slice(py, state.as_slice());
            let returned = self.object.bind(py).call_method1(method, (state, dt))?;
            arrays::square(&returned, size, &format!("what {method} returns"))
        };
        Python::attach(call).unwrap_or_else(|error| {
            self.failure.keep(error);
            DMatrix::repeat(size, size, f64::NAN)
        })
    }
}

impl DynamicMotion for PythonMotion {
    fn propagate(&self, state: &DVector<f64>, dt: f64) -> DVector<f64> {
        let size = state.len();
        let call = |py: Python<'_>| {
            let state = PyArray1::from_slice(py, state.as_slice());
            let moved = self.object.bind(py).call_method1("propagate", (state, dt))?;
            arrays::as_many(&moved, size, "what propagate returns")
        };
        Python::attach(call).unwrap_or_else(|error| {
            self.failure.keep(error);
            DVector::repeat(size, f64::NAN)
        })
    }

    fn noise_factor(&self, state: &DVector<f64>, dt: f64) -> DMatrix<f64> {
        self.matrix("noise_factor", state, dt)
    }

    fn jacobian(&self, state: &DVector<f64>, dt: f64) -> DMatrix<f64> {
        if self.has_jacobian {
            return self.matrix("jacobian", state, dt);
        }
        ByDifferences(self).jacobian(state, dt)
    }
}

/// A motion or a model without its own derivative.
struct ByDifferences<'a, T>(&'a T);

impl DynamicMotion for ByDifferences<'_, PythonMotion> {
    fn propagate(&self, state: &DVector<f64>, dt: f64) -> DVector<f64> {
        self.0.propagate(state, dt)
    }

    fn noise_factor(&self, state: &DVector<f64>, dt: f64) -> DMatrix<f64> {
        self.0.noise_factor(state, dt)
    }
}

impl DynamicMeasurement for ByDifferences<'_, PythonModel> {
    fn quantities(&self) -> Vec<Quantity> {
        self.0.quantities()
    }

    fn expected(&self, state: &DVector<f64>, receiver: &Pose) -> DVector<f64> {
        self.0.expected(state, receiver)
    }
}

/// A random walk of any number of components, in units per √second.
pub struct Walk(pub Vec<f64>);

impl DynamicMotion for Walk {
    fn propagate(&self, state: &DVector<f64>, _dt: f64) -> DVector<f64> {
        state.clone()
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn noise_factor(&self, _state: &DVector<f64>, dt: f64) -> DMatrix<f64> {
        DMatrix::from_diagonal(&(DVector::from_column_slice(&self.0) * dt.sqrt()))
    }

    fn jacobian(&self, state: &DVector<f64>, _dt: f64) -> DMatrix<f64> {
        DMatrix::identity(state.len(), state.len())
    }
}

/// A measurement model that is written in Python, over states of any size.
pub struct PythonModel {
    pub object: Py<PyAny>,
    pub quantities: Vec<Quantity>,
    /// Components of the state that it is over; all of them where absent.
    pub components: Option<Vec<usize>>,
    pub has_jacobian: bool,
    pub receivers: Receivers,
    pub failure: Failure,
}

impl DynamicMeasurement for PythonModel {
    fn quantities(&self) -> Vec<Quantity> {
        self.quantities.clone()
    }

    fn components(&self) -> Option<&[usize]> {
        self.components.as_deref()
    }

    fn expected(&self, state: &DVector<f64>, receiver: &Pose) -> DVector<f64> {
        let size = self.quantities.len();
        let call = |py: Python<'_>| {
            let state = PyArray1::from_slice(py, state.as_slice());
            let receiver = self.receivers.of(py, receiver)?;
            let expected = self.object.bind(py).call_method1("expected", (state, receiver))?;
            arrays::as_many(&expected, size, "what expected returns")
        };
        Python::attach(call).unwrap_or_else(|error| {
            self.failure.keep(error);
            DVector::repeat(size, f64::NAN)
        })
    }

    fn jacobian(&self, state: &DVector<f64>, receiver: &Pose) -> DMatrix<f64> {
        if !self.has_jacobian {
            return ByDifferences(self).jacobian(state, receiver);
        }
        let rows = self.quantities.len();
        let columns = state.len();
        let call = |py: Python<'_>| {
            let state = PyArray1::from_slice(py, state.as_slice());
            let receiver = self.receivers.of(py, receiver)?;
            let jacobian = self.object.bind(py).call_method1("jacobian", (state, receiver))?;
            arrays::of_shape(&jacobian, rows, columns, "what jacobian returns")
        };
        Python::attach(call).unwrap_or_else(|error| {
            self.failure.keep(error);
            DMatrix::repeat(rows, columns, f64::NAN)
        })
    }
}
