use foxhunt::{
    core::{self, Observation, Pose},
    filters::{
        Ckf, Ekf, Gate, GridConfig, GridFilter, Iterations, Kalman, ParticleFilter, Transform, Ukf,
        Unscented,
    },
    nalgebra::SMatrix,
};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::{exceptions::PyValueError, prelude::*};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::{
    arrays,
    failure::{Failure, value_error},
    model::{AnyModel, components, model},
    motion::{AnyMotion, motion},
};

/// The belief of an estimator: the mean and the covariance of its state.
#[pyclass(frozen, get_all, module = "foxhunt")]
#[derive(Debug)]
pub(crate) struct Estimate {
    /// The mean.
    mean: Py<PyArray1<f64>>,
    /// The covariance about the mean.
    covariance: Py<PyArray2<f64>>,
}

#[pymethods]
impl Estimate {
    fn __repr__(&self, py: Python<'_>) -> String {
        format!("Estimate(mean={}, covariance={})", self.mean.bind(py), self.covariance.bind(py))
    }
}

/// Result of an update.
#[pyclass(frozen, get_all, module = "foxhunt")]
#[derive(Debug)]
pub(crate) struct Correction {
    /// True if the gate kept the observation out.
    rejected: bool,
    /// The normalised innovation squared, where the estimator has an innovation.
    nis: Option<f64>,
    /// The log of the predictive density at the observation, where it was fused.
    log_evidence: Option<f64>,
    /// 1 / Σ w², where the belief is a weighted cloud.
    effective_sample_size: Option<f64>,
}

#[pymethods]
impl Correction {
    fn __repr__(&self) -> String {
        let Self { rejected, nis, log_evidence, .. } = self;
        format!("Correction(rejected={rejected}, nis={nis:?}, log_evidence={log_evidence:?})")
    }
}

impl From<core::Correction> for Correction {
    fn from(correction: core::Correction) -> Self {
        let (log_evidence, effective_sample_size) = match correction {
            core::Correction::Fused { log_evidence, effective_sample_size, .. } => {
                (Some(log_evidence), effective_sample_size)
            }
            _ => (None, None),
        };
        let rejected = correction.is_rejected();
        let nis = correction.nis();
        Self { rejected, nis, log_evidence, effective_sample_size }
    }
}

/// States, one a row, and their weights.
type Samples<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

/// A recursive Bayesian estimator; see the classes that derive from it.
#[pyclass(subclass, module = "foxhunt")]
pub(crate) struct Estimator {
    steps: Box<dyn Steps>,
    failure: Failure,
}

/// The settings of every kind of estimator.
struct Settings<'a> {
    kind: &'a str,
    gate: Option<f64>,
    iterations: u32,
    alpha: f64,
    beta: f64,
    kappa: f64,
    particles: usize,
    side: usize,
    seed: u64,
}

/// Arguments of every kind of estimator.
struct Parts<'a, 'py> {
    motion: &'a Bound<'py, PyAny>,
    model: &'a Bound<'py, PyAny>,
    mean: &'a Bound<'py, PyAny>,
    covariance: &'a Bound<'py, PyAny>,
    failure: &'a Failure,
}

#[pymethods]
impl Estimator {
    #[new]
    #[pyo3(signature = (
        kind, motion, model, mean, covariance, *, gate=None, iterations=1, alpha=1.0, beta=2.0,
        kappa=0.0, particles=2000, side=64, seed=1
    ))]
    #[expect(clippy::too_many_arguments, reason = "Python's are named")]
    fn new(
        kind: &str,
        motion: &Bound<'_, PyAny>,
        model: &Bound<'_, PyAny>,
        mean: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
        gate: Option<f64>,
        iterations: u32,
        alpha: f64,
        beta: f64,
        kappa: f64,
        particles: usize,
        side: usize,
        seed: u64,
    ) -> PyResult<Self> {
        let settings =
            Settings { kind, gate, iterations, alpha, beta, kappa, particles, side, seed };
        let failure = Failure::default();
        let parts = Parts { motion, model, mean, covariance, failure: &failure };
        let n = arrays::length(mean, "mean")?;
        let m = components(model)?;
        macro_rules! of_size {
            ($($n:literal)+) => {
                match (n, m) {
                    $(
                        ($n, 1) => steps::<$n, 1>(&settings, &parts),
                        ($n, 2) => steps::<$n, 2>(&settings, &parts),
                        ($n, 3) => steps::<$n, 3>(&settings, &parts),
                    )+
                    _ => Err(PyValueError::new_err(format!(
                        "the state has {n} and the measurement {m} components; \
                         there must be 2 to 6, and 1 to 3"
                    ))),
                }
            };
        }
        let steps = of_size!(2 3 4 5 6)?;
        Ok(Self { steps, failure })
    }

    /// Carries the belief `dt` seconds forward.
    fn predict(&mut self, py: Python<'_>, dt: f64) -> PyResult<()> {
        let steps = &mut self.steps;
        let result = py.detach(|| steps.predict(dt));
        self.raised(result.map_err(value_error))
    }

    /// Conditions the belief on a measurement made now.
    ///
    /// `value` has a number for each component, None where it was not measured; `noise` is the
    /// covariance of its errors, or their standard deviations; `receiver` is where it was received
    /// (East, North, Up, in metres); `time` in seconds is what a gate's and a log's messages name.
    /// Raises ValueError, and leaves the belief as it was, where anything is out of its range.
    #[pyo3(signature = (value, noise, *, receiver=(0.0, 0.0, 0.0), time=0.0))]
    fn update(
        &mut self,
        py: Python<'_>,
        value: Vec<Option<f64>>,
        noise: &Bound<'_, PyAny>,
        receiver: (f64, f64, f64),
        time: f64,
    ) -> PyResult<Correction> {
        let receiver = Pose::at(receiver.0, receiver.1, receiver.2);
        let result = self.steps.update(py, &value, noise, receiver, time);
        self.raised(result).map(Correction::from)
    }

    /// The mean and the covariance of the belief.
    fn estimate(&self, py: Python<'_>) -> PyResult<Estimate> {
        self.steps.estimate(py)
    }

    /// States, one a row, and weights that stand for the whole belief.
    fn samples<'py>(&self, py: Python<'py>) -> PyResult<Samples<'py>> {
        self.steps.samples(py)
    }

    /// The normalised estimation error squared against the true state; `None` where the covariance
    /// is not positive definite.
    fn nees(&self, truth: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
        self.steps.nees(truth)
    }

    /// The ellipse that holds the place with a probability, if the belief is Gaussian: the
    /// semi-axes in metres, and the direction of the longer one in radians counter-clockwise from
    /// East.
    #[pyo3(signature = (probability=0.95))]
    fn ellipse(&self, probability: f64) -> Option<(f64, f64, f64)> {
        self.steps.ellipse(probability)
    }
}

impl Estimator {
    /// The result of a step, unless a model or a motion of Python raised in it.
    fn raised<T>(&self, result: PyResult<T>) -> PyResult<T> {
        match self.failure.take() {
            Some(error) => Err(error),
            None => result,
        }
    }
}

/// An estimator of any size.
trait Steps: Send + Sync {
    fn predict(&mut self, dt: f64) -> Result<(), core::EstimatorError>;

    fn update(
        &mut self,
        py: Python<'_>,
        value: &[Option<f64>],
        noise: &Bound<'_, PyAny>,
        receiver: Pose,
        time: f64,
    ) -> PyResult<core::Correction>;

    fn estimate(&self, py: Python<'_>) -> PyResult<Estimate>;

    fn samples<'py>(&self, py: Python<'py>) -> PyResult<Samples<'py>>;

    fn nees(&self, truth: &Bound<'_, PyAny>) -> PyResult<Option<f64>>;

    fn ellipse(&self, probability: f64) -> Option<(f64, f64, f64)>;
}

/// An estimator of a size that is known when it is compiled.
struct Sized<const N: usize, const M: usize>(Box<dyn core::Estimator<N, M> + Send + Sync>);

impl<const N: usize, const M: usize> Steps for Sized<N, M> {
    fn predict(&mut self, dt: f64) -> Result<(), core::EstimatorError> {
        self.0.predict(dt)
    }

    fn update(
        &mut self,
        py: Python<'_>,
        value: &[Option<f64>],
        noise: &Bound<'_, PyAny>,
        receiver: Pose,
        time: f64,
    ) -> PyResult<core::Correction> {
        if value.len() != M {
            let text = format!("value has {} components; the model measures {M}", value.len());
            return Err(PyValueError::new_err(text));
        }
        let noise = match arrays::vector::<M>(noise, "noise") {
            Ok(sigma) => SMatrix::from_diagonal(&sigma.component_mul(&sigma)),
            Err(_) => arrays::matrix::<M>(noise, "noise")?,
        };
        // What is missing holds no number.
        let numbers = SMatrix::from_fn(|row, _| value[row].unwrap_or(0.0));
        let mut observation =
            Observation::new(time, receiver, numbers, noise).map_err(value_error)?;
        for (component, _) in value.iter().enumerate().filter(|(_, value)| value.is_none()) {
            observation = observation.without(component);
        }
        py.detach(|| self.0.update(&observation)).map_err(value_error)
    }

    fn estimate(&self, py: Python<'_>) -> PyResult<Estimate> {
        let core::Estimate { mean, covariance } = self.0.estimate();
        // Symmetric: rows are columns.
        let flat = PyArray1::from_slice(py, covariance.as_slice());
        Ok(Estimate {
            mean: PyArray1::from_slice(py, mean.as_slice()).unbind(),
            covariance: flat.reshape([N, N])?.unbind(),
        })
    }

    fn samples<'py>(&self, py: Python<'py>) -> PyResult<Samples<'py>> {
        let mut states = Vec::new();
        let mut weights = Vec::new();
        self.0.visit_samples(&mut |state, weight| {
            states.extend_from_slice(state.as_slice());
            weights.push(weight);
        });
        let states = PyArray1::from_vec(py, states).reshape([weights.len(), N])?;
        Ok((states, PyArray1::from_vec(py, weights)))
    }

    fn nees(&self, truth: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
        Ok(self.0.estimate().nees(&arrays::vector(truth, "truth")?))
    }

    fn ellipse(&self, probability: f64) -> Option<(f64, f64, f64)> {
        let core::Estimate { mean, covariance } = self.0.estimate();
        let place = core::Estimate::<2> {
            mean: mean.fixed_rows::<2>(0).into_owned(),
            covariance: covariance.fixed_view::<2, 2>(0, 0).into_owned(),
        };
        let ellipse = place.ellipse(probability)?;
        Some((ellipse.semi_major, ellipse.semi_minor, ellipse.orientation))
    }
}

/// The estimator of a kind for states of N and measurements of M components.
fn steps<const N: usize, const M: usize>(
    settings: &Settings<'_>,
    parts: &Parts<'_, '_>,
) -> PyResult<Box<dyn Steps>> {
    let motion: AnyMotion<N> = motion(parts.motion, parts.failure)?;
    let model: AnyModel<N, M> = model(parts.model, parts.failure)?;
    let prior = core::Estimate {
        mean: arrays::vector(parts.mean, "mean")?,
        covariance: arrays::matrix(parts.covariance, "covariance")?,
    };
    let Settings { kind, particles, seed, .. } = *settings;
    Ok(match kind {
        "ekf" => kalman(Ekf::new(motion, model, prior), settings)?,
        "ckf" => kalman(Ckf::new(motion, model, prior), settings)?,
        "ukf" => {
            let Settings { alpha, beta, kappa, .. } = *settings;
            let transform = Unscented::new(alpha, beta, kappa).map_err(value_error)?;
            let filter = Ukf::new(motion, model, prior);
            kalman(filter.and_then(|filter| filter.with_transform(transform)), settings)?
        }
        "particle" => {
            let rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let filter = ParticleFilter::new(motion, model, prior, particles, rng);
            Box::new(Sized(Box::new(filter.map_err(value_error)?.with_threads())))
        }
        "grid" => {
            let side = settings.side;
            let most_per_side = side.max(GridConfig::default().most_per_side);
            let config = GridConfig { side, most_per_side, ..GridConfig::default() };
            let filter = GridFilter::new(motion, model, prior, config).map_err(value_error)?;
            Box::new(Sized(Box::new(filter)))
        }
        _ => {
            let text = format!("kind is {kind:?}; it must be ekf, ukf, ckf, particle or grid");
            return Err(PyValueError::new_err(text));
        }
    })
}

/// A Kalman filter with its gate and its iterations.
fn kalman<T, const N: usize, const M: usize>(
    filter: Result<Kalman<T, AnyMotion<N>, AnyModel<N, M>, N, M>, core::EstimatorError>,
    settings: &Settings<'_>,
) -> PyResult<Box<dyn Steps>>
where
    T: Transform + Send + Sync + 'static,
{
    let mut filter = filter.map_err(value_error)?;
    if let Some(probability) = settings.gate {
        filter = filter.with_gate(Gate::probability(probability).map_err(value_error)?);
    }
    let iterations = Iterations::at_most(settings.iterations).map_err(value_error)?;
    Ok(Box::new(Sized(Box::new(filter.with_iterations(iterations)))))
}
