use std::{
    any::Any,
    collections::BTreeSet,
    sync::{Arc, Mutex, PoisonError},
};

use foxhunt::{
    core::{
        Axis, DynamicMeasurement, MeasurementModel, Observation, On, Pose, Quantity, State,
        columns, log_likelihoods_one_by_one, numeric_jacobian, residuals_one_by_one,
    },
    nalgebra::{SMatrix, SVector, Vector3},
    sensors::{
        BearingOnly, FreePathLossRssBearing, FreePowerRssBearing, LogDistance, RangeDifference,
        Rss, RssBearing,
    },
};
use numpy::PyArray1;
use pyo3::{exceptions::PyValueError, prelude::*, types::PyTuple};

use crate::{
    arrays,
    failure::{Failure, value_error},
    joint, pose,
    recipe::Recipe,
};

/// Measurement model of a receiver, for states of N and measurements of M components.
pub type AnyModel<const N: usize, const M: usize> = Arc<dyn MeasurementModel<N, M> + Send + Sync>;

/// A measurement model of the library.
#[pyclass(frozen, module = "foxhunt")]
#[derive(Debug)]
pub struct Model {
    kind: Kind,
    recipe: Recipe,
}

#[derive(Debug)]
enum Kind {
    Rss(Rss<LogDistance>),
    Bearing(BearingOnly),
    RangeDifference(RangeDifference),
    RssBearing(RssBearing<LogDistance>),
    FreePower(FreePowerRssBearing),
    FreePathLoss(FreePathLossRssBearing),
}

#[pymethods]
impl Model {
    /// The level of a transmitter of known power: `reference_dbm` at 1 m, falling by 10 `exponent`
    /// dB a decade of the slant range; `target_up` is its height in metres.
    #[staticmethod]
    #[pyo3(signature = (reference_dbm, exponent, *, target_up=0.0))]
    fn rss(reference_dbm: f64, exponent: f64, target_up: f64) -> PyResult<Self> {
        let law = LogDistance::new(reference_dbm, exponent).map_err(value_error)?;
        let model = Rss::new(law).with_target_up(target_up).map_err(value_error)?;
        let recipe = law_recipe("rss", reference_dbm, exponent, target_up);
        Ok(Self { kind: Kind::Rss(model), recipe })
    }

    /// The direction from the receiver to the target, in radians counter-clockwise from East.
    #[staticmethod]
    fn bearing() -> Self {
        Self { kind: Kind::Bearing(BearingOnly::new()), recipe: Recipe::new("bearing") }
    }

    /// Level and bearing of a transmitter of known power.
    #[staticmethod]
    #[pyo3(signature = (reference_dbm, exponent, *, target_up=0.0))]
    fn rss_bearing(reference_dbm: f64, exponent: f64, target_up: f64) -> PyResult<Self> {
        let law = LogDistance::new(reference_dbm, exponent).map_err(value_error)?;
        let model = RssBearing::new(law).with_target_up(target_up).map_err(value_error)?;
        let recipe = law_recipe("rss_bearing", reference_dbm, exponent, target_up);
        Ok(Self { kind: Kind::RssBearing(model), recipe })
    }

    /// Level and bearing of a transmitter whose power in dBm at 1 m is the state's last component.
    #[staticmethod]
    #[pyo3(signature = (exponent, *, target_up=0.0))]
    fn free_power(exponent: f64, target_up: f64) -> PyResult<Self> {
        let model = FreePowerRssBearing::new(exponent).map_err(value_error)?;
        let model = model.with_target_up(target_up).map_err(value_error)?;
        let recipe = Recipe::new("free_power").with("exponent", exponent);
        let recipe = recipe.with("target_up", target_up);
        Ok(Self { kind: Kind::FreePower(model), recipe })
    }

    /// Level and bearing of a transmitter whose power in dBm at 1 m and path-loss exponent are the
    /// state's last two components.
    #[staticmethod]
    #[pyo3(signature = (*, target_up=0.0))]
    fn free_path_loss(target_up: f64) -> PyResult<Self> {
        let model = FreePathLossRssBearing::new();
        let model = model.with_target_up(target_up).map_err(value_error)?;
        let recipe = Recipe::new("free_path_loss").with("target_up", target_up);
        Ok(Self { kind: Kind::FreePathLoss(model), recipe })
    }

    /// Range difference: the target's distance from the receiver minus that from `reference`, a
    /// place of three coordinates, in metres.
    #[staticmethod]
    #[pyo3(signature = (reference, *, target_up=0.0))]
    fn range_difference(reference: &Bound<'_, PyAny>, target_up: f64) -> PyResult<Self> {
        let reference: Vector3<f64> = arrays::vector(reference, "reference")?;
        let model = RangeDifference::new(reference).map_err(value_error)?;
        let model = model.with_target_up(target_up).map_err(value_error)?;
        let recipe = Recipe::new("range_difference")
            .with_several("reference", reference.as_slice())
            .with("target_up", target_up);
        Ok(Self { kind: Kind::RangeDifference(model), recipe })
    }

    /// The components: the name with its unit, and "linear" or "angle".
    #[getter]
    fn quantities(&self) -> Vec<(&'static str, &'static str)> {
        const LEVEL_AND_BEARING: [(&str, &str); 2] =
            [("rss_dbm", "linear"), ("bearing_rad", "angle")];
        match self.kind {
            Kind::Rss(_) => vec![LEVEL_AND_BEARING[0]],
            Kind::Bearing(_) => vec![LEVEL_AND_BEARING[1]],
            Kind::RangeDifference(_) => vec![("range_difference_m", "linear")],
            _ => LEVEL_AND_BEARING.to_vec(),
        }
    }

    fn __repr__(&self) -> String {
        format!("Model.{}", self.recipe)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        slf.get().recipe.reduced(&slf.get_type())
    }
}

/// The call of a model over a law of propagation.
fn law_recipe(method: &'static str, reference_dbm: f64, exponent: f64, target_up: f64) -> Recipe {
    Recipe::new(method)
        .with("reference_dbm", reference_dbm)
        .with("exponent", exponent)
        .with("target_up", target_up)
}

/// Returns the number of components that a model measures: the library's, or any object with
/// `quantities`.
pub fn components(object: &Bound<'_, PyAny>) -> PyResult<usize> {
    object.getattr("quantities")?.len()
}

/// The model of a Python object: the library's, or any with `quantities` and
/// `expected(state, receiver)`.
pub fn model<const N: usize, const M: usize>(
    object: &Bound<'_, PyAny>,
    failure: &Failure,
) -> PyResult<AnyModel<N, M>> {
    let Ok(model) = object.cast::<Model>() else {
        return Ok(Arc::new(PythonModel::<M> {
            quantities: quantities(&object.getattr("quantities")?)?,
            is_vectorized: arrays::is_vectorized(object)?,
            has_jacobian: object.hasattr("jacobian")?,
            object: object.clone().unbind(),
            receivers: Receivers::default(),
            failure: failure.clone(),
        }));
    };
    match &model.get().kind {
        Kind::Rss(model) => of_size::<N, 1, N, M>(Arc::new(*model)),
        Kind::Bearing(model) => of_size::<N, 1, N, M>(Arc::new(*model)),
        Kind::RangeDifference(model) => of_size::<N, 1, N, M>(Arc::new(*model)),
        Kind::RssBearing(model) => of_size::<N, 2, N, M>(Arc::new(*model)),
        // The sizes of state that hold their parameters.
        Kind::FreePower(model) => match N {
            7 => of_size::<7, 2, N, M>(Arc::new(*model)),
            8 => of_size::<8, 2, N, M>(Arc::new(*model)),
            4 => of_size::<4, 2, N, M>(Arc::new(*model)),
            5 => of_size::<5, 2, N, M>(Arc::new(*model)),
            6 => of_size::<6, 2, N, M>(Arc::new(*model)),
            _ => of_size::<3, 2, N, M>(Arc::new(*model)),
        },
        Kind::FreePathLoss(model) => match N {
            7 => of_size::<7, 2, N, M>(Arc::new(*model)),
            8 => of_size::<8, 2, N, M>(Arc::new(*model)),
            5 => of_size::<5, 2, N, M>(Arc::new(*model)),
            6 => of_size::<6, 2, N, M>(Arc::new(*model)),
            _ => of_size::<4, 2, N, M>(Arc::new(*model)),
        },
    }
}

/// A measurement model over states of any size.
pub type AnyDynamicModel = Arc<dyn DynamicMeasurement + Send + Sync>;

/// The model of a Python object for a state of any size: the library's are over its first two
/// components, and its last ones where they have parameters; any other object as [`model`] takes
/// it, over the `components` that it names.
pub fn dynamic(
    object: &Bound<'_, PyAny>,
    size: usize,
    failure: &Failure,
) -> PyResult<AnyDynamicModel> {
    let Ok(model) = object.cast::<Model>() else {
        let components: Option<Vec<usize>> = match object.getattr_opt("components")? {
            Some(components) => Some(components.extract()?),
            None => None,
        };
        return Ok(Arc::new(joint::PythonModel {
            quantities: each_quantity(&object.getattr("quantities")?)?,
            components,
            has_jacobian: object.hasattr("jacobian")?,
            object: object.clone().unbind(),
            receivers: Receivers::default(),
            failure: failure.clone(),
        }));
    };
    if size < 4 {
        let text = format!("the state has {size} components; there must be 2 or more");
        return Err(PyValueError::new_err(text));
    }
    Ok(match &model.get().kind {
        Kind::Rss(model) => Arc::new(On::<_, 2, 1>::new(*model, [0, 1])),
        Kind::Bearing(model) => Arc::new(On::<_, 2, 1>::new(*model, [0, 1])),
        Kind::RangeDifference(model) => Arc::new(On::<_, 2, 1>::new(*model, [0, 1])),
        Kind::RssBearing(model) => Arc::new(On::<_, 2, 2>::new(*model, [0, 1])),
        Kind::FreePower(model) => Arc::new(On::<_, 3, 2>::new(*model, [0, 1, size - 1])),
        Kind::FreePathLoss(model) => {
            Arc::new(On::<_, 4, 2>::new(*model, [0, 1, size - 2, size - 1]))
        }
    })
}

/// A model for states of A and measurements of B components where one of N and M is wanted.
fn of_size<const A: usize, const B: usize, const N: usize, const M: usize>(
    model: AnyModel<A, B>,
) -> PyResult<AnyModel<N, M>> {
    let same = (Box::new(model) as Box<dyn Any>).downcast::<AnyModel<N, M>>();
    same.map(|model| *model).map_err(|_| {
        PyValueError::new_err(format!("the state has {N} components; the model is for {A} or more"))
    })
}

/// A model that is written in Python.
struct PythonModel<const M: usize> {
    object: Py<PyAny>,
    quantities: [Quantity; M],
    /// True if `expected` takes many states at once.
    is_vectorized: bool,
    /// True if the object has its own derivative; otherwise it is taken by differences.
    has_jacobian: bool,
    receivers: Receivers,
    failure: Failure,
}

/// Pose of the last call as Python has it: sigma points and particles share one.
#[derive(Default)]
pub struct Receivers(Mutex<Option<(Pose, Py<PyAny>)>>);

impl Receivers {
    /// The receiver as Python has it.
    pub fn of<'py>(&self, py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyAny>> {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((last, made)) = &*last
            && last == pose
        {
            return Ok(made.bind(py).clone());
        }
        // Python may run other threads in between, which want the lock, too.
        drop(last);
        let made = pose::to_python(py, pose)?;
        // All calls at this pose are given it: none may write into it.
        for array in [&made, &made.getattr("_plain")?] {
            array.getattr("flags")?.setattr("writeable", false)?;
        }
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *last = Some((*pose, made.clone().unbind()));
        Ok(made)
    }
}

impl<const M: usize> PythonModel<M> {
    /// The expected measurements of many states.
    fn expected_rows<const N: usize>(
        &self,
        columns: [&[f64]; N],
        receiver: &Pose,
    ) -> Option<Vec<SVector<f64, M>>> {
        let count = columns.first().map_or(0, |column| column.len());
        let call = |py: Python<'_>| {
            let states = arrays::states(py, columns)?;
            let receiver = self.receivers.of(py, receiver)?;
            let expected = self.object.bind(py).call_method1("expected", (states, receiver))?;
            arrays::rows(&expected, count, "what expected returns")
        };
        Python::attach(call).map_err(|error| self.failure.keep(error)).ok()
    }
}

impl<const N: usize, const M: usize> MeasurementModel<N, M> for PythonModel<M> {
    fn quantities(&self) -> [Quantity; M] {
        self.quantities
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> SVector<f64, M> {
        let call = |py: Python<'_>| {
            let state = PyArray1::from_slice(py, state.as_slice());
            let receiver = self.receivers.of(py, receiver)?;
            let expected = self.object.bind(py).call_method1("expected", (state, receiver))?;
            arrays::vector(&expected, "what expected returns")
        };
        Python::attach(call).unwrap_or_else(|error| {
            self.failure.keep(error);
            SVector::repeat(f64::NAN)
        })
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, M, N> {
        if !self.has_jacobian {
            let expected = |x: &State<N>| MeasurementModel::<N, M>::expected(self, x, receiver);
            return numeric_jacobian(state, expected, |a, b| {
                MeasurementModel::<N, M>::residual(self, a, b)
            });
        }
        let call = |py: Python<'_>| {
            let state = PyArray1::from_slice(py, state.as_slice());
            let receiver = self.receivers.of(py, receiver)?;
            let jacobian = self.object.bind(py).call_method1("jacobian", (state, receiver))?;
            arrays::matrix(&jacobian, "what jacobian returns")
        };
        Python::attach(call).unwrap_or_else(|error| {
            self.failure.keep(error);
            SMatrix::repeat(f64::NAN)
        })
    }

    fn expected_many(&self, states: &[State<N>], receiver: &Pose, out: &mut [SVector<f64, M>]) {
        if !self.is_vectorized {
            for (out, state) in out.iter_mut().zip(states) {
                *out = self.expected(state, receiver);
            }
            return;
        }
        let columns: [Vec<f64>; N] =
            std::array::from_fn(|row| states.iter().map(|state| state[row]).collect());
        match self.expected_rows(columns::slices(&columns), receiver) {
            Some(expected) => out.copy_from_slice(&expected),
            None => out.fill(SVector::repeat(f64::NAN)),
        }
    }

    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<M>, out: &mut [f64]) {
        if !self.is_vectorized || !observation.is_plain() {
            log_likelihoods_one_by_one(self, columns, observation, out);
            return;
        }
        let Some(expected) = self.expected_rows(columns, observation.receiver()) else {
            out.fill(f64::NAN);
            return;
        };
        let axes = self.quantities.map(|quantity| quantity.axis());
        for (out, expected) in out.iter_mut().zip(&expected) {
            let residual = Axis::difference(&axes, observation.value(), expected);
            *out = observation.log_density(&residual);
        }
    }

    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &SVector<f64, M>,
        receiver: &Pose,
        mut out: [&mut [f64]; M],
    ) {
        if !self.is_vectorized {
            residuals_one_by_one(self, columns, z, receiver, out);
            return;
        }
        let Some(expected) = self.expected_rows(columns, receiver) else {
            out.iter_mut().for_each(|column| column.fill(f64::NAN));
            return;
        };
        let axes = self.quantities.map(|quantity| quantity.axis());
        for (i, expected) in expected.iter().enumerate() {
            let residual = Axis::difference(&axes, z, expected);
            out.iter_mut().zip(&residual).for_each(|(column, value)| column[i] = *value);
        }
    }
}

/// The quantities of a Python model: pairs of a name and "linear" or "angle".
pub fn quantities<const M: usize>(object: &Bound<'_, PyAny>) -> PyResult<[Quantity; M]> {
    let each = each_quantity(object)?;
    each.try_into().map_err(|_| PyValueError::new_err(format!("there must be {M} quantities")))
}

/// The quantities of a Python model, as [`quantities`].
fn each_quantity(object: &Bound<'_, PyAny>) -> PyResult<Vec<Quantity>> {
    let pairs: Vec<(String, String)> = object.extract().map_err(|_| {
        PyValueError::new_err(format!(
            "quantities is {object}; it must be pairs such as (\"range_m\", \"linear\")"
        ))
    })?;
    let each = pairs.iter().map(|(name, axis)| match axis.as_str() {
        "angle" if name.split('_').any(|part| part == "deg") => {
            Err(PyValueError::new_err(format!(
                "{name} is an angle in degrees; angles are in radians, such as \"bearing_rad\""
            )))
        }
        "linear" => Ok(Quantity::linear(kept(name))),
        "angle" => Ok(Quantity::angle(kept(name))),
        _ => Err(PyValueError::new_err(format!(
            "the geometry of {name} is {axis:?}; it must be \"linear\" or \"angle\""
        ))),
    });
    each.collect()
}

/// The name for as long as the program runs, kept once however many models have it.
fn kept(name: &str) -> &'static str {
    static NAMES: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(name) = names.get(name) {
        return name;
    }
    let name: &'static str = Box::leak(name.to_owned().into_boxed_str());
    names.insert(name);
    name
}
