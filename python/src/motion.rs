use std::{any::Any, sync::Arc};

use foxhunt::{
    core::{
        ConstantVelocity, CoordinatedTurn, MotionModel, RandomWalk, State, parameter::not_negative,
    },
    nalgebra::SMatrix,
};
use numpy::PyArray1;
use pyo3::{exceptions::PyValueError, prelude::*};

use crate::{
    arrays,
    failure::{Failure, value_error},
};

/// Motion model of the target, for states of N components.
pub(crate) type AnyMotion<const N: usize> = Arc<dyn MotionModel<N> + Send + Sync>;

/// A motion of the library.
#[pyclass(frozen, module = "foxhunt")]
#[derive(Debug)]
pub(crate) struct Motion(Kind);

#[derive(Debug)]
enum Kind {
    RandomWalk { drift: Vec<f64> },
    ConstantVelocity(ConstantVelocity),
    CoordinatedTurn(CoordinatedTurn),
}

#[pymethods]
impl Motion {
    /// Every component of the state does a random walk of `drift` units per root second: one value
    /// for all, or one for each.
    #[staticmethod]
    fn random_walk(drift: &Bound<'_, PyAny>) -> PyResult<Self> {
        let drift = match drift.extract::<f64>() {
            Ok(drift) => vec![drift],
            Err(_) => drift.extract::<Vec<f64>>()?,
        };
        for each in &drift {
            not_negative("drift", *each).map_err(value_error)?;
        }
        Ok(Self(Kind::RandomWalk { drift }))
    }

    /// The state is East, North and their speeds, in m and m/s, driven by white acceleration;
    /// `acceleration_density` is the root of its spectral density, in m/s² per √Hz.
    #[staticmethod]
    fn constant_velocity(acceleration_density: f64) -> PyResult<Self> {
        not_negative("acceleration_density", acceleration_density).map_err(value_error)?;
        Ok(Self(Kind::ConstantVelocity(ConstantVelocity { acceleration_density })))
    }

    /// As `constant_velocity`, and the rate of turn in rad/s, which does a random walk of
    /// `turn_rate_drift` rad/s per √s.
    #[staticmethod]
    fn coordinated_turn(acceleration_density: f64, turn_rate_drift: f64) -> PyResult<Self> {
        not_negative("acceleration_density", acceleration_density).map_err(value_error)?;
        not_negative("turn_rate_drift", turn_rate_drift).map_err(value_error)?;
        let turn = CoordinatedTurn { acceleration_density, turn_rate_drift };
        Ok(Self(Kind::CoordinatedTurn(turn)))
    }

    fn __repr__(&self) -> String {
        format!("Motion({:?})", self.0)
    }
}

/// The motion of a Python object: the library's, or any with `propagate(state, dt)` and
/// `noise_factor(state, dt)`.
pub(crate) fn motion<const N: usize>(
    object: &Bound<'_, PyAny>,
    failure: &Failure,
) -> PyResult<AnyMotion<N>> {
    let Ok(motion) = object.cast::<Motion>() else {
        for method in ["propagate", "noise_factor"] {
            object.getattr(method)?;
        }
        return Ok(Arc::new(PythonMotion::<N> {
            object: object.clone().unbind(),
            failure: failure.clone(),
        }));
    };
    match &motion.get().0 {
        Kind::RandomWalk { drift } => match drift[..] {
            [drift] => Ok(Arc::new(RandomWalk::<N>::uniform(drift))),
            _ if drift.len() == N => {
                Ok(Arc::new(RandomWalk { drift: State::<N>::from_column_slice(drift) }))
            }
            _ => Err(PyValueError::new_err(format!(
                "drift has {} components; the state has {N}",
                drift.len()
            ))),
        },
        Kind::ConstantVelocity(motion) => of_size::<4, N>(Arc::new(*motion)),
        Kind::CoordinatedTurn(motion) => of_size::<5, N>(Arc::new(*motion)),
    }
}

/// A motion of K components where one of N is wanted.
fn of_size<const K: usize, const N: usize>(motion: AnyMotion<K>) -> PyResult<AnyMotion<N>> {
    let same = (Box::new(motion) as Box<dyn Any>).downcast::<AnyMotion<N>>();
    same.map(|motion| *motion).map_err(|_| {
        PyValueError::new_err(format!("the state has {N} components; the motion is of {K}"))
    })
}

/// A motion that is written in Python.
struct PythonMotion<const N: usize> {
    object: Py<PyAny>,
    failure: Failure,
}

impl<const N: usize> MotionModel<N> for PythonMotion<N> {
    fn propagate(&self, state: &State<N>, dt: f64) -> State<N> {
        let call = |py: Python<'_>| {
            let state = PyArray1::from_slice(py, state.as_slice());
            let moved = self.object.bind(py).call_method1("propagate", (state, dt))?;
            arrays::vector(&moved, "what propagate returns")
        };
        Python::attach(call).unwrap_or_else(|error| {
            self.failure.keep(error);
            State::repeat(f64::NAN)
        })
    }

    fn noise_factor(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
        let call = |py: Python<'_>| {
            let state = PyArray1::from_slice(py, state.as_slice());
            let factor = self.object.bind(py).call_method1("noise_factor", (state, dt))?;
            arrays::matrix(&factor, "what noise_factor returns")
        };
        Python::attach(call).unwrap_or_else(|error| {
            self.failure.keep(error);
            SMatrix::repeat(f64::NAN)
        })
    }
}
