use std::{
    any::Any,
    collections::BTreeSet,
    sync::{Arc, Mutex, PoisonError},
};

use foxhunt::{
    core::{MeasurementModel, Pose, Quantity, State},
    nalgebra::{SVector, Vector3},
    sensors::{
        BearingOnly, FreePathLossRssBearing, FreePowerRssBearing, LogDistance, RangeDifference,
        Rss, RssBearing,
    },
};
use numpy::PyArray1;
use pyo3::{exceptions::PyValueError, prelude::*};

use crate::{
    arrays,
    failure::{Failure, value_error},
};

/// Measurement model of a receiver, for states of N and measurements of M components.
pub(crate) type AnyModel<const N: usize, const M: usize> =
    Arc<dyn MeasurementModel<N, M> + Send + Sync>;

/// A measurement model of the library.
#[pyclass(frozen, module = "foxhunt")]
#[derive(Debug)]
pub(crate) struct Model(Kind);

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
        Ok(Self(Kind::Rss(model)))
    }

    /// The direction from the receiver to the target, in radians counter-clockwise from East.
    #[staticmethod]
    fn bearing() -> Self {
        Self(Kind::Bearing(BearingOnly::new()))
    }

    /// Level and bearing of a transmitter of known power.
    #[staticmethod]
    #[pyo3(signature = (reference_dbm, exponent, *, target_up=0.0))]
    fn rss_bearing(reference_dbm: f64, exponent: f64, target_up: f64) -> PyResult<Self> {
        let law = LogDistance::new(reference_dbm, exponent).map_err(value_error)?;
        let model = RssBearing::new(law).with_target_up(target_up).map_err(value_error)?;
        Ok(Self(Kind::RssBearing(model)))
    }

    /// Level and bearing of a transmitter whose power in dBm at 1 m is the state's last component.
    #[staticmethod]
    #[pyo3(signature = (exponent, *, target_up=0.0))]
    fn free_power(exponent: f64, target_up: f64) -> PyResult<Self> {
        let model = FreePowerRssBearing::new(exponent).map_err(value_error)?;
        Ok(Self(Kind::FreePower(model.with_target_up(target_up).map_err(value_error)?)))
    }

    /// Level and bearing of a transmitter whose power in dBm at 1 m and path-loss exponent are the
    /// state's last two components.
    #[staticmethod]
    #[pyo3(signature = (*, target_up=0.0))]
    fn free_path_loss(target_up: f64) -> PyResult<Self> {
        let model = FreePathLossRssBearing::new();
        Ok(Self(Kind::FreePathLoss(model.with_target_up(target_up).map_err(value_error)?)))
    }

    /// Range difference: the target's distance from the receiver minus that from `reference`, a
    /// place of three coordinates, in metres.
    #[staticmethod]
    #[pyo3(signature = (reference, *, target_up=0.0))]
    fn range_difference(reference: &Bound<'_, PyAny>, target_up: f64) -> PyResult<Self> {
        let reference: Vector3<f64> = arrays::vector(reference, "reference")?;
        let model = RangeDifference::new(reference).map_err(value_error)?;
        let model = model.with_target_up(target_up).map_err(value_error)?;
        Ok(Self(Kind::RangeDifference(model)))
    }

    /// The components: the name with its unit, and "linear" or "angle".
    #[getter]
    fn quantities(&self) -> Vec<(&'static str, &'static str)> {
        const LEVEL_AND_BEARING: [(&str, &str); 2] =
            [("rss_dbm", "linear"), ("bearing_rad", "angle")];
        match self.0 {
            Kind::Rss(_) => vec![LEVEL_AND_BEARING[0]],
            Kind::Bearing(_) => vec![LEVEL_AND_BEARING[1]],
            Kind::RangeDifference(_) => vec![("range_difference_m", "linear")],
            _ => LEVEL_AND_BEARING.to_vec(),
        }
    }

    fn __repr__(&self) -> String {
        format!("Model({:?})", self.0)
    }
}

/// Returns the number of components that a model measures: the library's, or any object with
/// `quantities`.
pub(crate) fn components(object: &Bound<'_, PyAny>) -> PyResult<usize> {
    object.getattr("quantities")?.len()
}

/// The model of a Python object: the library's, or any with `quantities` and
/// `expected(state, receiver)`.
pub(crate) fn model<const N: usize, const M: usize>(
    object: &Bound<'_, PyAny>,
    failure: &Failure,
) -> PyResult<AnyModel<N, M>> {
    let Ok(model) = object.cast::<Model>() else {
        return Ok(Arc::new(PythonModel::<M> {
            quantities: quantities(&object.getattr("quantities")?)?,
            object: object.clone().unbind(),
            failure: failure.clone(),
        }));
    };
    match &model.get().0 {
        Kind::Rss(model) => of_size::<N, 1, N, M>(Arc::new(*model)),
        Kind::Bearing(model) => of_size::<N, 1, N, M>(Arc::new(*model)),
        Kind::RangeDifference(model) => of_size::<N, 1, N, M>(Arc::new(*model)),
        Kind::RssBearing(model) => of_size::<N, 2, N, M>(Arc::new(*model)),
        // The sizes of state that hold their parameters.
        Kind::FreePower(model) => match N {
            4 => of_size::<4, 2, N, M>(Arc::new(*model)),
            5 => of_size::<5, 2, N, M>(Arc::new(*model)),
            6 => of_size::<6, 2, N, M>(Arc::new(*model)),
            _ => of_size::<3, 2, N, M>(Arc::new(*model)),
        },
        Kind::FreePathLoss(model) => match N {
            5 => of_size::<5, 2, N, M>(Arc::new(*model)),
            6 => of_size::<6, 2, N, M>(Arc::new(*model)),
            _ => of_size::<4, 2, N, M>(Arc::new(*model)),
        },
    }
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
    failure: Failure,
}

impl<const N: usize, const M: usize> MeasurementModel<N, M> for PythonModel<M> {
    fn quantities(&self) -> [Quantity; M] {
        self.quantities
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> SVector<f64, M> {
        let call = |py: Python<'_>| {
            let state = PyArray1::from_slice(py, state.as_slice());
            let receiver = PyArray1::from_slice(py, receiver.position.as_slice());
            let expected = self.object.bind(py).call_method1("expected", (state, receiver))?;
            arrays::vector(&expected, "what expected returns")
        };
        Python::attach(call).unwrap_or_else(|error| {
            self.failure.keep(error);
            SVector::repeat(f64::NAN)
        })
    }
}

/// The quantities of a Python model: pairs of a name and "linear" or "angle".
fn quantities<const M: usize>(object: &Bound<'_, PyAny>) -> PyResult<[Quantity; M]> {
    let pairs: Vec<(String, String)> = object.extract().map_err(|_| {
        PyValueError::new_err(format!(
            "quantities is {object}; it must be pairs such as (\"range_m\", \"linear\")"
        ))
    })?;
    let each = pairs.iter().map(|(name, axis)| match axis.as_str() {
        "linear" => Ok(Quantity::linear(kept(name))),
        "angle" => Ok(Quantity::angle(kept(name))),
        _ => Err(PyValueError::new_err(format!(
            "the geometry of {name} is {axis:?}; it must be \"linear\" or \"angle\""
        ))),
    });
    let each: Vec<Quantity> = each.collect::<PyResult<_>>()?;
    each.try_into().map_err(|_| PyValueError::new_err(format!("there must be {M} quantities")))
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
