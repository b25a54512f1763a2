//! Receivers' poses, from Python and for models of Python.

use foxhunt::{core::Pose, nalgebra::Vector3};
use numpy::{PyArray1, PyUntypedArray};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyList, PyTuple},
};

use crate::arrays;

/// The pose of a receiver: two or three coordinates, or a `foxhunt.Pose`; a heading and a velocity
/// that are given beside it replace its own.
pub fn pose(
    receiver: Option<&Bound<'_, PyAny>>,
    heading: Option<f64>,
    velocity: Option<&Bound<'_, PyAny>>,
) -> PyResult<Pose> {
    let mut pose = Pose::default();
    if let Some(receiver) = receiver {
        pose.position = place(receiver, "receiver")?;
        // Neither sequences nor plain arrays have more than a place.
        let is_plain = receiver.is_exact_instance_of::<PyTuple>()
            || receiver.is_exact_instance_of::<PyList>()
            || receiver.is_exact_instance_of::<PyUntypedArray>();
        if !is_plain && receiver.hasattr("heading")? {
            pose.heading = receiver.getattr("heading")?.extract()?;
            pose.pitch = receiver.getattr("pitch")?.extract()?;
            pose.roll = receiver.getattr("roll")?.extract()?;
            let velocity = receiver.getattr("velocity")?;
            if !velocity.is_none() {
                pose.velocity = Some(place(&velocity, "velocity")?);
            }
        }
    }
    if let Some(heading) = heading {
        pose.heading = heading;
    }
    if let Some(velocity) = velocity {
        pose.velocity = Some(place(velocity, "velocity")?);
    }
    Ok(pose)
}

/// East, North and Up; a missing Up is 0.
fn place(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vector3<f64>> {
    let numbers = arrays::numbers(value, name)?;
    match numbers[..] {
        [east, north] => Ok(Vector3::new(east, north, 0.0)),
        [east, north, up] => Ok(Vector3::new(east, north, up)),
        _ => {
            let text = format!("{name} is {value}; it must be 2 or 3 numbers: East, North, Up");
            Err(PyValueError::new_err(text))
        }
    }
}

/// The pose as Python's models get it: a `foxhunt.Pose`.
pub fn to_python<'py>(py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyAny>> {
    let Pose { position, heading, pitch, roll, velocity } = pose;
    let array = |vector: &Vector3<f64>| PyArray1::from_slice(py, vector.as_slice());
    let velocity = velocity.as_ref().map(array);
    let class = py.import("foxhunt.poses")?.getattr("Pose")?;
    class.call1((array(position), heading, pitch, roll, velocity))
}
