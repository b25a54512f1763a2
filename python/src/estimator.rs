use std::{any::Any, fmt::Write as _};

use foxhunt::{
    core::{self, Observation, Pose},
    filters::{
        self, Ckf, Ekf, Gate, GridConfig, GridFilter, Iterations, Kalman, ParticleFilter,
        Transform, Ukf, Unscented,
    },
    nalgebra::{DMatrix, DVector, SMatrix, Vector3},
};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyDict, PyList, PyString, PyTuple},
};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::{
    arrays,
    failure::{Failure, value_error},
    joint::joint,
    model::{AnyModel, components, model},
    motion::{AnyMotion, motion},
    pose::pose,
};

/// The belief of an estimator: the mean and the covariance of its state.
#[pyclass(frozen, get_all, module = "foxhunt")]
#[derive(Debug)]
pub struct Estimate {
    /// The mean.
    mean: Py<PyArray1<f64>>,
    /// The covariance about the mean.
    covariance: Py<PyArray2<f64>>,
}

impl Estimate {
    pub fn of(mean: Py<PyArray1<f64>>, covariance: Py<PyArray2<f64>>) -> Self {
        Self { mean, covariance }
    }
}

#[pymethods]
impl Estimate {
    #[new]
    fn new(mean: Py<PyArray1<f64>>, covariance: Py<PyArray2<f64>>) -> Self {
        Self { mean, covariance }
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let repr = |array: PyResult<Bound<'_, PyString>>| {
            array.map(|text| text.to_string()).unwrap_or_default()
        };
        let mean = repr(self.mean.bind(py).repr());
        let covariance = repr(self.covariance.bind(py).repr());
        format!("Estimate(mean={mean}, covariance={covariance})")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let Self { mean, covariance } = slf.get();
        let py = slf.py();
        (slf.get_type(), (mean.clone_ref(py), covariance.clone_ref(py))).into_pyobject(py)
    }
}

/// Result of an update.
#[pyclass(frozen, get_all, module = "foxhunt")]
#[derive(Debug)]
pub struct Correction {
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
    #[new]
    #[pyo3(signature = (rejected, nis=None, log_evidence=None, effective_sample_size=None))]
    fn new(
        rejected: bool,
        nis: Option<f64>,
        log_evidence: Option<f64>,
        effective_sample_size: Option<f64>,
    ) -> Self {
        Self { rejected, nis, log_evidence, effective_sample_size }
    }

    fn __repr__(&self) -> String {
        let Self { rejected, nis, log_evidence, effective_sample_size } = self;
        let rejected = if *rejected { "True" } else { "False" };
        let mut text = format!("Correction(rejected={rejected}");
        let numbers = [
            ("nis", nis),
            ("log_evidence", log_evidence),
            ("effective_sample_size", effective_sample_size),
        ];
        for (name, value) in numbers {
            if let Some(value) = value {
                let _ = write!(text, ", {name}={value:?}");
            }
        }
        text + ")"
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let Self { rejected, nis, log_evidence, effective_sample_size } = *slf.get();
        let values = (rejected, nis, log_evidence, effective_sample_size);
        (slf.get_type(), values).into_pyobject(slf.py())
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

/// Difference between a measurement and its expectation under the belief.
#[pyclass(frozen, get_all, module = "foxhunt")]
#[derive(Debug)]
pub struct Innovation {
    /// The measurement less its expectation; NaN for a missing component.
    residual: Py<PyArray1<f64>>,
    /// The expectation, in the measurement's units; NaN for a missing component.
    expected: Py<PyArray1<f64>>,
    /// The covariance of the residual; a missing component has a variance of 1 and no covariance.
    covariance: Py<PyArray2<f64>>,
    /// The normalised innovation squared.
    nis: f64,
    /// The residual in standard deviations, uncorrelated, as `whiteness` takes it; NaN for a
    /// missing component.
    normalised: Py<PyArray1<f64>>,
}

#[pymethods]
impl Innovation {
    #[new]
    fn new(
        residual: Py<PyArray1<f64>>,
        expected: Py<PyArray1<f64>>,
        covariance: Py<PyArray2<f64>>,
        nis: f64,
        normalised: Py<PyArray1<f64>>,
    ) -> Self {
        Self { residual, expected, covariance, nis, normalised }
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let Self { residual, covariance, nis, .. } = self;
        let residual = residual.bind(py).repr()?;
        let covariance = covariance.bind(py).repr()?;
        Ok(format!("Innovation(residual={residual}, covariance={covariance}, nis={nis:?})"))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let Self { residual, expected, covariance, nis, normalised } = slf.get();
        let py = slf.py();
        let own = [residual, expected, normalised].map(|array| array.clone_ref(py));
        let [residual, expected, normalised] = own;
        let values = (residual, expected, covariance.clone_ref(py), *nis, normalised);
        (slf.get_type(), values).into_pyobject(py)
    }
}

/// Numbers of an innovation. A missing component has a residual of 0, a variance of 1 and no
/// covariance.
pub struct Innovated {
    pub residual: DVector<f64>,
    pub expected: DVector<f64>,
    pub covariance: DMatrix<f64>,
    pub nis: f64,
}

/// Mean and covariance of a prior.
pub type Prior<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// States, one a row, and their weights.
pub type Samples<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

/// A recursive Bayesian estimator; see the classes that derive from it.
#[pyclass(subclass, module = "foxhunt")]
pub struct Estimator {
    steps: Box<dyn Steps>,
    failure: Failure,
    /// Arguments that it was made of.
    made_of: MadeOf,
    /// The steps so far, by which a pickle makes it again; `None` once there are too many, and for
    /// a smoothed belief.
    history: Option<Vec<Past>>,
}

/// The number of steps after which an estimator cannot be pickled any more: some 15 MB.
const MOST_STEPS: usize = 100_000;

/// Arguments of an estimator, as Python gave them.
struct MadeOf {
    positional: Py<PyTuple>,
    keywords: Py<PyDict>,
}

/// A step that was taken or refused.
#[derive(Clone)]
enum Past {
    Predict(f64),
    Update(Box<Update>),
}

/// The numbers of an update.
#[derive(Clone)]
pub struct Update {
    pub value: Vec<Option<f64>>,
    /// The rows of its covariance.
    pub noise: Vec<f64>,
    pub receiver: Pose,
    pub time: f64,
}

/// An update as it stands in a pickle: values, noise, time, and the numbers of the pose.
type Pickled = (Vec<Option<f64>>, Vec<f64>, f64, [f64; 6], Option<[f64; 3]>);

impl Update {
    fn pickled(&self) -> Pickled {
        let Pose { position, heading, pitch, roll, velocity } = self.receiver;
        let pose = [position.x, position.y, position.z, heading, pitch, roll];
        let velocity = velocity.map(|velocity| velocity.into());
        (self.value.clone(), self.noise.clone(), self.time, pose, velocity)
    }

    fn of_pickled((value, noise, time, pose, velocity): Pickled) -> Self {
        let [east, north, up, heading, pitch, roll] = pose;
        let position = Vector3::new(east, north, up);
        let velocity = velocity.map(Vector3::from);
        let receiver = Pose { position, heading, pitch, roll, velocity };
        Self { value, noise, receiver, time }
    }
}

/// The settings of every kind of estimator.
pub struct Settings<'a> {
    pub kind: &'a str,
    pub gate: Option<f64>,
    pub iterations: u32,
    pub alpha: f64,
    pub beta: f64,
    pub kappa: f64,
    pub particles: usize,
    pub side: usize,
    pub seed: u64,
}

/// Arguments of every kind of estimator.
pub struct Parts<'a, 'py> {
    pub motion: &'a Bound<'py, PyAny>,
    pub model: &'a Bound<'py, PyAny>,
    pub mean: &'a Bound<'py, PyAny>,
    pub covariance: &'a Bound<'py, PyAny>,
    pub failure: &'a Failure,
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
        let steps = match (n, m) {
            (2..=8, 1..=3) => of_size!(n, m, steps(&settings, &parts))?,
            _ => joint(n, m, &settings, &parts)?,
        };
        let py = mean.py();
        let keywords = PyDict::new(py);
        keywords.set_item("gate", gate)?;
        keywords.set_item("iterations", iterations)?;
        keywords.set_item("alpha", alpha)?;
        keywords.set_item("beta", beta)?;
        keywords.set_item("kappa", kappa)?;
        keywords.set_item("particles", particles)?;
        keywords.set_item("side", side)?;
        keywords.set_item("seed", seed)?;
        let (mean, covariance) = steps.prior(py, mean, covariance)?;
        let positional = (kind, motion, model, mean, covariance).into_pyobject(py)?.unbind();
        let made_of = MadeOf { positional, keywords: keywords.unbind() };
        Ok(Self { steps, failure, made_of, history: Some(Vec::new()) })
    }

    /// Carries the belief `dt` seconds forward.
    fn predict(&mut self, py: Python<'_>, dt: f64) -> PyResult<()> {
        self.note(|| Past::Predict(dt));
        let steps = &mut self.steps;
        let result = py.detach(|| steps.predict(dt));
        self.raised(result.map_err(value_error))
    }

    /// Conditions the belief on a measurement made now.
    ///
    /// `value` has a number for each component, None where it was not measured; `noise` is the
    /// covariance of its errors, or their standard deviations. A single component may be a number,
    /// and its noise another: the standard deviation, not the variance.
    /// `receiver` is where it was received (East, North and, unless it is 0, Up, in metres), as a
    /// sequence, an array or a `Pose`, the origin unless given; `heading` in radians and `velocity`
    /// in m/s are its own. `time` in seconds is what a gate's and a log's messages name; its order
    /// is not checked.
    /// Raises ValueError, and leaves the belief as it was, where anything is out of its range.
    #[pyo3(signature = (value, noise, *, receiver=None, heading=None, velocity=None, time=0.0))]
    #[expect(clippy::too_many_arguments, reason = "Python's are named")]
    fn update(
        &mut self,
        py: Python<'_>,
        value: &Bound<'_, PyAny>,
        noise: &Bound<'_, PyAny>,
        receiver: Option<&Bound<'_, PyAny>>,
        heading: Option<f64>,
        velocity: Option<&Bound<'_, PyAny>>,
        time: f64,
    ) -> PyResult<Correction> {
        let update = self.measured(value, noise, receiver, heading, velocity, time)?;
        self.update_by(py, update)
    }

    /// The difference between a measurement and its expectation under the belief, which is not
    /// changed.
    ///
    /// The arguments are the ones of `update`. The result is `None` for a measurement without
    /// components. An expectation that is not finite gives `None` for particles and cells, and
    /// raises ValueError for a Kalman filter.
    #[pyo3(signature = (value, noise, *, receiver=None, heading=None, velocity=None, time=0.0))]
    #[expect(clippy::too_many_arguments, reason = "Python's are named")]
    fn innovation(
        &self,
        py: Python<'_>,
        value: &Bound<'_, PyAny>,
        noise: &Bound<'_, PyAny>,
        receiver: Option<&Bound<'_, PyAny>>,
        heading: Option<f64>,
        velocity: Option<&Bound<'_, PyAny>>,
        time: f64,
    ) -> PyResult<Option<Innovation>> {
        let update = self.measured(value, noise, receiver, heading, velocity, time)?;
        let found = self.raised(self.steps.innovation(py, &update))?;
        let missing: Vec<bool> = update.value.iter().map(Option::is_none).collect();
        found.map(|innovated| innovated.into_python(py, &missing)).transpose()
    }

    /// Conditions the belief on `later`: the smoothed belief `dt` seconds afterwards, of a copy
    /// that went on from this one (`Remembering` does so for a whole run).
    ///
    /// Raises ValueError, and leaves the belief as it was, for an estimator of another kind or
    /// size, a negative `dt`, and a setting for which there is no smoother.
    fn smooth(&mut self, py: Python<'_>, later: &Bound<'_, Self>, dt: f64) -> PyResult<()> {
        let later = later.try_borrow().map_err(|_| {
            PyValueError::new_err("an estimator cannot be smoothed by itself, but by a later copy")
        })?;
        let later = &*later.steps;
        let steps = &mut self.steps;
        let result = py.detach(|| steps.smooth(later, dt));
        self.raised(result.unwrap_or_else(|| {
            let text =
                "later is an estimator of another kind or size; it must be a copy that went on";
            Err(PyValueError::new_err(text))
        }))?;
        self.history = None;
        Ok(())
    }

    /// Pairs of a name and "linear" or "angle", as its model has them.
    #[getter]
    fn quantities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.made_of.positional.bind(py).get_item(2)?.getattr("quantities")
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

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let name = slf.get_type().name()?;
        let estimator = slf.borrow();
        let mean = estimator.estimate(slf.py())?.mean;
        let mean: Vec<String> =
            mean.bind(slf.py()).to_vec()?.iter().map(|value| format!("{value:.6}")).collect();
        let of = estimator.made_of.positional.bind(slf.py());
        let motion = of.get_item(1)?.repr()?;
        let model = of.get_item(2)?.repr()?;
        Ok(format!("<{name}: mean [{}], {motion}, {model}>", mean.join(", ")))
    }

    /// Contents of a pickle: the arguments and all steps, which are taken again.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let py = slf.py();
        let estimator = slf.borrow();
        let Some(history) = &estimator.history else {
            return Err(PyValueError::new_err(format!(
                "the estimator was smoothed, or has taken more than {MOST_STEPS} steps, which a \
                 pickle would take again; copy.deepcopy copies it, and an estimator that is made \
                 of its estimate goes on from there"
            )));
        };
        let steps = PyList::empty(py);
        for past in history {
            match past {
                Past::Predict(dt) => steps.append(dt)?,
                Past::Update(update) => steps.append(update.pickled())?,
            }
        }
        let made_again = py.import("foxhunt.estimators")?.getattr("_made_again")?;
        let MadeOf { positional, keywords } = &estimator.made_of;
        let own = slf.getattr_opt("__dict__")?;
        let estimate = estimator.estimate(py)?;
        let arguments =
            (slf.get_type(), positional.bind(py), keywords.bind(py), steps, own, estimate);
        (made_again, arguments).into_pyobject(py)
    }

    /// A copy without its steps, of which a run keeps many.
    fn _remembered<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let history = slf.borrow_mut().history.take();
        let copied = Self::__copy__(slf);
        slf.borrow_mut().history = history;
        copied
    }

    fn __copy__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let copied = py.import("foxhunt.estimators")?.getattr("_copied")?;
        let estimator = slf.borrow();
        let MadeOf { positional, keywords } = &estimator.made_of;
        let own = slf.getattr_opt("__dict__")?;
        copied.call1((slf, positional.bind(py), keywords.bind(py), own))
    }

    /// As `__copy__`: motion and model do not change, and are shared.
    fn __deepcopy__<'py>(
        slf: &Bound<'py, Self>,
        _memo: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        Self::__copy__(slf)
    }

    /// Takes the steps of a pickle; those that were refused (`ValueError`) are refused again, and
    /// any other error ends it.
    fn _take(&mut self, py: Python<'_>, steps: Vec<Bound<'_, PyAny>>) -> PyResult<()> {
        for step in steps {
            let taken = if let Ok(dt) = step.extract::<f64>() {
                self.predict(py, dt).map(drop)
            } else {
                self.update_by(py, Update::of_pickled(step.extract()?)).map(drop)
            };
            match taken {
                Err(error) if !error.is_instance_of::<PyValueError>(py) => return Err(error),
                _ => {}
            }
        }
        Ok(())
    }

    /// Takes over the belief and the steps of another one of the same sizes.
    fn _take_over(&mut self, other: &Bound<'_, Self>) -> PyResult<()> {
        let other = other.try_borrow()?;
        self.steps = other.steps.copied();
        self.failure = other.failure.clone();
        self.history = other.history.clone();
        Ok(())
    }
}

impl Innovated {
    fn into_python(self, py: Python<'_>, missing: &[bool]) -> PyResult<Innovation> {
        let Self { mut residual, mut expected, covariance, nis } = self;
        let factor = covariance.clone().cholesky().ok_or_else(|| {
            PyValueError::new_err("the innovation's covariance is not positive definite")
        })?;
        let mut normalised = residual.clone();
        factor.l_dirty().solve_lower_triangular_mut(&mut normalised);
        for (component, _) in missing.iter().enumerate().filter(|(_, missing)| **missing) {
            residual[component] = f64::NAN;
            expected[component] = f64::NAN;
            normalised[component] = f64::NAN;
        }
        let of = |vector: &DVector<f64>| PyArray1::from_slice(py, vector.as_slice()).unbind();
        // Symmetric: rows are columns.
        let flat = PyArray1::from_slice(py, covariance.as_slice());
        Ok(Innovation {
            residual: of(&residual),
            expected: of(&expected),
            covariance: flat.reshape([missing.len(), missing.len()])?.unbind(),
            nis,
            normalised: of(&normalised),
        })
    }
}

impl Estimator {
    /// A measurement as Python gave it.
    fn measured(
        &self,
        value: &Bound<'_, PyAny>,
        noise: &Bound<'_, PyAny>,
        receiver: Option<&Bound<'_, PyAny>>,
        heading: Option<f64>,
        velocity: Option<&Bound<'_, PyAny>>,
        time: f64,
    ) -> PyResult<Update> {
        let receiver = pose(receiver, heading, velocity)?;
        let value = match arrays::number(value) {
            Some(value) => vec![Some(value)],
            None => value.extract()?,
        };
        Ok(Update { value, noise: self.steps.noise(noise)?, receiver, time })
    }

    fn update_by(&mut self, py: Python<'_>, update: Update) -> PyResult<Correction> {
        self.note(|| Past::Update(Box::new(update.clone())));
        let result = self.steps.update(py, &update);
        self.raised(result).map(Correction::from)
    }

    fn note(&mut self, past: impl FnOnce() -> Past) {
        match &mut self.history {
            Some(history) if history.len() < MOST_STEPS => history.push(past()),
            history => *history = None,
        }
    }

    /// The result of a step, unless a model or a motion of Python raised in it.
    fn raised<T>(&self, result: PyResult<T>) -> PyResult<T> {
        match self.failure.take() {
            Some(error) => Err(error),
            None => result,
        }
    }
}

/// An estimator of any size.
pub trait Steps: Any + Send + Sync {
    fn predict(&mut self, dt: f64) -> Result<(), core::EstimatorError>;

    /// The rows of a covariance that is given, or of that of standard deviations.
    fn noise(&self, noise: &Bound<'_, PyAny>) -> PyResult<Vec<f64>>;

    fn update(&mut self, py: Python<'_>, update: &Update) -> PyResult<core::Correction>;

    /// `None` for a measurement without components.
    fn innovation(&self, py: Python<'_>, update: &Update) -> PyResult<Option<Innovated>>;

    fn copied(&self) -> Box<dyn Steps>;

    /// Conditions the belief on a later one; `None` if that is of another kind or size.
    fn smooth(&mut self, later: &dyn Steps, dt: f64) -> Option<PyResult<()>>;

    /// A prior as arrays of its own.
    fn prior<'py>(
        &self,
        py: Python<'py>,
        mean: &Bound<'py, PyAny>,
        covariance: &Bound<'py, PyAny>,
    ) -> PyResult<Prior<'py>>;

    fn estimate(&self, py: Python<'_>) -> PyResult<Estimate>;

    fn samples<'py>(&self, py: Python<'py>) -> PyResult<Samples<'py>>;

    fn nees(&self, truth: &Bound<'_, PyAny>) -> PyResult<Option<f64>>;

    fn ellipse(&self, probability: f64) -> Option<(f64, f64, f64)>;
}

/// An estimator of a size that is known when it is compiled.
struct Sized<const N: usize, const M: usize> {
    filter: Box<dyn Copied<N, M>>,
    model: AnyModel<N, M>,
    own_innovation: OwnInnovation<N, M>,
}

/// A filter's own innovation; `None` for a family that has none.
type OwnInnovation<const N: usize, const M: usize> =
    fn(&dyn Any, &Observation<M>) -> Option<Result<filters::Innovation<M>, core::EstimatorError>>;

/// An estimator that can be copied and smoothed behind its pointer.
trait Copied<const N: usize, const M: usize>: core::Estimator<N, M> + Any + Send + Sync {
    fn copied(&self) -> Box<dyn Copied<N, M>>;

    /// `None` if the later one is of another kind.
    fn smooth_by(&mut self, later: &dyn Any, dt: f64) -> Option<Result<(), core::EstimatorError>>;
}

impl<E, const N: usize, const M: usize> Copied<N, M> for E
where
    E: core::Smooth<N, M> + Clone + Send + Sync + 'static,
{
    fn copied(&self) -> Box<dyn Copied<N, M>> {
        Box::new(self.clone())
    }

    fn smooth_by(&mut self, later: &dyn Any, dt: f64) -> Option<Result<(), core::EstimatorError>> {
        later.downcast_ref().map(|later| self.smooth(later, dt))
    }
}

/// A measurement of a size that is known when this is compiled.
fn observation<const M: usize>(update: &Update) -> PyResult<Observation<M>> {
    let Update { value, noise, receiver, time } = update;
    if value.len() != M {
        let text = format!("value has {} components; the model measures {M}", value.len());
        return Err(PyValueError::new_err(text));
    }
    if noise.len() != M * M {
        let text = format!("noise has {} numbers; the model measures {M}", noise.len());
        return Err(PyValueError::new_err(text));
    }
    let noise = SMatrix::from_row_slice(noise);
    // What is missing holds no number.
    let numbers = SMatrix::from_fn(|row, _| value[row].unwrap_or(0.0));
    let mut observation =
        Observation::new(*time, *receiver, numbers, noise).map_err(value_error)?;
    for (component, _) in value.iter().enumerate().filter(|(_, value)| value.is_none()) {
        observation = observation.without(component);
    }
    Ok(observation)
}

impl<const N: usize, const M: usize> Steps for Sized<N, M> {
    fn predict(&mut self, dt: f64) -> Result<(), core::EstimatorError> {
        self.filter.predict(dt)
    }

    fn noise(&self, noise: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
        let noise = arrays::covariance::<M>(noise, "noise")?;
        // By columns.
        Ok(noise.transpose().as_slice().to_vec())
    }

    fn update(&mut self, py: Python<'_>, update: &Update) -> PyResult<core::Correction> {
        let observation = observation(update)?;
        py.detach(|| self.filter.update(&observation)).map_err(value_error)
    }

    fn innovation(&self, py: Python<'_>, update: &Update) -> PyResult<Option<Innovated>> {
        let observation = observation(update)?;
        if observation.is_empty() {
            return Ok(None);
        }
        let Self { filter, model, own_innovation } = self;
        let found = py.detach(|| match own_innovation(&**filter, &observation) {
            Some(own) => own.map(Some),
            None => Ok(filters::Innovation::of_belief(&**filter, &**model, &observation)),
        });
        Ok(found.map_err(value_error)?.map(|innovation| Innovated {
            residual: DVector::from_column_slice(innovation.residual.as_slice()),
            expected: DVector::from_column_slice(innovation.expected.as_slice()),
            covariance: DMatrix::from_column_slice(M, M, innovation.covariance.as_slice()),
            nis: innovation.nis,
        }))
    }

    fn copied(&self) -> Box<dyn Steps> {
        Box::new(Self {
            filter: self.filter.copied(),
            model: self.model.clone(),
            own_innovation: self.own_innovation,
        })
    }

    fn smooth(&mut self, later: &dyn Steps, dt: f64) -> Option<PyResult<()>> {
        let later: &Self = (later as &dyn Any).downcast_ref()?;
        let smoothed = self.filter.smooth_by(&*later.filter, dt)?;
        Some(smoothed.map_err(value_error))
    }

    fn prior<'py>(
        &self,
        py: Python<'py>,
        mean: &Bound<'py, PyAny>,
        covariance: &Bound<'py, PyAny>,
    ) -> PyResult<Prior<'py>> {
        let mean = arrays::vector::<N>(mean, "mean")?;
        let covariance = arrays::matrix::<N, N>(covariance, "covariance")?.transpose();
        let flat = PyArray1::from_slice(py, covariance.as_slice());
        Ok((PyArray1::from_slice(py, mean.as_slice()), flat.reshape([N, N])?))
    }

    fn estimate(&self, py: Python<'_>) -> PyResult<Estimate> {
        let core::Estimate { mean, covariance } = self.filter.estimate();
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
        self.filter.visit_samples(&mut |state, weight| {
            states.extend_from_slice(state.as_slice());
            weights.push(weight);
        });
        let states = PyArray1::from_vec(py, states).reshape([weights.len(), N])?;
        Ok((states, PyArray1::from_vec(py, weights)))
    }

    fn nees(&self, truth: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
        Ok(self.filter.estimate().nees(&arrays::vector(truth, "truth")?))
    }

    fn ellipse(&self, probability: f64) -> Option<(f64, f64, f64)> {
        let core::Estimate { mean, covariance } = self.filter.estimate();
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
        "ekf" => kalman(Ekf::new(motion, model.clone(), prior), model, settings)?,
        "ckf" => kalman(Ckf::new(motion, model.clone(), prior), model, settings)?,
        "ukf" => {
            let Settings { alpha, beta, kappa, .. } = *settings;
            let transform = Unscented::new(alpha, beta, kappa).map_err(value_error)?;
            let filter = Ukf::new(motion, model.clone(), prior);
            let filter = filter.and_then(|filter| filter.with_transform(transform));
            kalman(filter, model, settings)?
        }
        "particle" => {
            let rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let filter = ParticleFilter::new(motion, model.clone(), prior, particles, rng);
            let filter = Box::new(filter.map_err(value_error)?.with_threads());
            Box::new(Sized { filter, model, own_innovation: |_, _| None })
        }
        "grid" => {
            let side = settings.side;
            let most_per_side = side.max(GridConfig::default().most_per_side);
            let config = GridConfig { side, most_per_side, ..GridConfig::default() };
            let filter =
                GridFilter::new(motion, model.clone(), prior, config).map_err(value_error)?;
            Box::new(Sized { filter: Box::new(filter), model, own_innovation: |_, _| None })
        }
        _ => {
            let text = format!("kind is {kind:?}; it must be ekf, ukf, ckf, particle or grid");
            return Err(PyValueError::new_err(text));
        }
    })
}

/// A Kalman filter over the parts of this module.
type Made<T, const N: usize, const M: usize> = Kalman<T, AnyMotion<N>, AnyModel<N, M>, N, M>;

/// A Kalman filter with its gate and its iterations.
fn kalman<T, const N: usize, const M: usize>(
    filter: Result<Made<T, N, M>, core::EstimatorError>,
    model: AnyModel<N, M>,
    settings: &Settings<'_>,
) -> PyResult<Box<dyn Steps>>
where
    T: Transform + Clone + Send + Sync + 'static,
{
    let mut filter = filter.map_err(value_error)?;
    if let Some(probability) = settings.gate {
        filter = filter.with_gate(Gate::probability(probability).map_err(value_error)?);
    }
    let iterations = Iterations::at_most(settings.iterations).map_err(value_error)?;
    let own_innovation: OwnInnovation<N, M> = |filter, observation| {
        filter.downcast_ref::<Made<T, N, M>>().map(|filter| filter.innovation(observation))
    };
    let filter = Box::new(filter.with_iterations(iterations));
    Ok(Box::new(Sized { filter, model, own_innovation }))
}
