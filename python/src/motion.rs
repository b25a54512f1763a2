use std::{any::Any, sync::Arc};

use foxhunt::{
    core::{
        ConstantVelocity, CoordinatedTurn, MotionModel, RandomWalk, State, columns,
        numeric_jacobian, parameter::not_negative,
    },
    filters::JointMotion,
    nalgebra::SMatrix,
};
use numpy::PyArray1;
use pyo3::{exceptions::PyValueError, prelude::*, types::PyTuple};

use crate::{
    arrays,
    failure::{Failure, value_error},
    joint,
    recipe::Recipe,
};

/// Motion model of the target, for states of N components.
pub type AnyMotion<const N: usize> = Arc<dyn MotionModel<N> + Send + Sync>;

/// A motion of the library.
#[pyclass(frozen, module = "foxhunt")]
#[derive(Debug)]
pub struct Motion {
    kind: Kind,
    recipe: Recipe,
}

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
        let recipe = Recipe::new("random_walk").with_several("drift", &drift);
        Ok(Self { kind: Kind::RandomWalk { drift }, recipe })
    }

    /// The state is East, North and their speeds, in m and m/s, driven by white acceleration; or
    /// East, North, Up and their speeds, where it has 6 components. `spectral_density` is q of the
    /// acceleration on each axis, in m²/s³, as filterpy's and Stone Soup's.
    #[staticmethod]
    fn constant_velocity(spectral_density: f64) -> PyResult<Self> {
        not_negative("spectral_density", spectral_density).map_err(value_error)?;
        let recipe = Recipe::new("constant_velocity").with("spectral_density", spectral_density);
        let kind = Kind::ConstantVelocity(ConstantVelocity { spectral_density });
        Ok(Self { kind, recipe })
    }

    /// As `constant_velocity`, and behind it the rate of turn in rad/s, which does a random walk of
    /// `turn_rate_drift` rad/s per √s; of 5 components, or 7 in space.
    #[staticmethod]
    fn coordinated_turn(spectral_density: f64, turn_rate_drift: f64) -> PyResult<Self> {
        not_negative("spectral_density", spectral_density).map_err(value_error)?;
        not_negative("turn_rate_drift", turn_rate_drift).map_err(value_error)?;
        let recipe = Recipe::new("coordinated_turn")
            .with("spectral_density", spectral_density)
            .with("turn_rate_drift", turn_rate_drift);
        let kind = Kind::CoordinatedTurn(CoordinatedTurn { spectral_density, turn_rate_drift });
        Ok(Self { kind, recipe })
    }

    fn __repr__(&self) -> String {
        format!("Motion.{}", self.recipe)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        slf.get().recipe.reduced(&slf.get_type())
    }
}

/// The motion of a Python object: the library's, or any with `propagate(state, dt)` and
/// `noise_factor(state, dt)`.
pub fn motion<const N: usize>(
    object: &Bound<'_, PyAny>,
    failure: &Failure,
) -> PyResult<AnyMotion<N>> {
    let Ok(motion) = object.cast::<Motion>() else {
        for method in ["propagate", "noise_factor"] {
            object.getattr(method)?;
        }
        return Ok(Arc::new(PythonMotion::<N> {
            is_vectorized: arrays::is_vectorized(object)?,
            has_jacobian: object.hasattr("jacobian")?,
            object: object.clone().unbind(),
            failure: failure.clone(),
        }));
    };
    match &motion.get().kind {
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
        // In the plane unless the state is that of space.
        Kind::ConstantVelocity(motion) => match N {
            6 => of_size::<6, N>(Arc::new(*motion)),
            _ => of_size::<4, N>(Arc::new(*motion)),
        },
        Kind::CoordinatedTurn(motion) => match N {
            7 => of_size::<7, N>(Arc::new(*motion)),
            _ => of_size::<5, N>(Arc::new(*motion)),
        },
    }
}

/// The motion of a Python object for a state of any size: a random walk of the library, or any
/// object as [`motion`] takes it.
pub fn dynamic(object: &Bound<'_, PyAny>, size: usize, failure: &Failure) -> PyResult<JointMotion> {
    let Ok(motion) = object.cast::<Motion>() else {
        for method in ["propagate", "noise_factor"] {
            object.getattr(method)?;
        }
        let motion = joint::PythonMotion {
            has_jacobian: object.hasattr("jacobian")?,
            object: object.clone().unbind(),
            failure: failure.clone(),
        };
        return Ok(JointMotion::new().with_block(size, motion));
    };
    let drift = match &motion.get().kind {
        Kind::RandomWalk { drift } if drift.len() == 1 => vec![drift[0]; size],
        Kind::RandomWalk { drift } if drift.len() == size => drift.clone(),
        Kind::RandomWalk { drift } => {
            let given = drift.len();
            let text = format!("drift has {given} components; the state has {size}");
            return Err(PyValueError::new_err(text));
        }
        _ => {
            return Err(PyValueError::new_err(format!(
                "the state has {size} components; the motion is of 4, 5, 6 or 7"
            )));
        }
    };
    Ok(JointMotion::new().with_block(size, joint::Walk(drift)))
}

/// A motion of K components where one of N is wanted.
fn of_size<const K: usize, const N: usize>(motion: AnyMotion<K>) -> PyResult<AnyMotion<N>> {
    let same = (Box::new(motion) as Box<dyn Any>).downcast::<AnyMotion<N>>();
    same.map(|motion| *motion).map_err(|_| {
        let more = K + 2;
        PyValueError::new_err(format!(
            "the state has {N} components; the motion is of {K}, or {more} in space"
        ))
    })
}

/// A motion that is written in Python.
struct PythonMotion<const N: usize> {
    is_vectorized: bool,
    /// True if the object has its own derivative; otherwise it is taken by differences.
    has_jacobian: bool,
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

    fn jacobian(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
        if !self.has_jacobian {
            return numeric_jacobian(state, |x| self.propagate(x, dt), |a, b| a - b);
        }
        let call = |py: Python<'_>| {
            let state = PyArray1::from_slice(py, state.as_slice());
            let jacobian = self.object.bind(py).call_method1("jacobian", (state, dt))?;
            arrays::matrix(&jacobian, "what jacobian returns")
        };
        Python::attach(call).unwrap_or_else(|error| {
            self.failure.keep(error);
            SMatrix::repeat(f64::NAN)
        })
    }

    fn move_columns(&self, mut columns: [&mut [f64]; N], white: [&[f64]; N], dt: f64) {
        let count = columns.first().map_or(0, |column| column.len());
        if !self.is_vectorized {
            for i in 0..count {
                let state = State::from_fn(|row, _| columns[row][i]);
                let noise = self.noise_factor(&state, dt) * State::from_fn(|row, _| white[row][i]);
                let moved = self.propagate(&state, dt) + noise;
                columns.iter_mut().zip(&moved).for_each(|(column, value)| column[i] = *value);
            }
            return;
        }
        let call = |py: Python<'_>| {
            let object = self.object.bind(py);
            let states = arrays::states(py, columns::slices(&columns))?;
            let moved = object.call_method1("propagate", (&states, dt))?;
            let factors = object.call_method1("noise_factor", (states, dt))?;
            let moved: Vec<State<N>> = arrays::rows(&moved, count, "what propagate returns")?;
            let factors: Vec<SMatrix<f64, N, N>> =
                arrays::matrices(&factors, count, "what noise_factor returns")?;
            Ok((moved, factors))
        };
        match Python::attach(call) {
            Ok((moved, factors)) => {
                for (i, moved) in moved.into_iter().enumerate() {
                    let factor = factors.get(i).unwrap_or(&factors[0]);
                    let moved = moved + factor * State::from_fn(|row, _| white[row][i]);
                    columns.iter_mut().zip(&moved).for_each(|(column, value)| column[i] = *value);
                }
            }
            Err(error) => {
                self.failure.keep(error);
                columns.iter_mut().for_each(|column| column.fill(f64::NAN));
            }
        }
    }
}
