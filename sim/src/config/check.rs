use std::fmt::Display;

use crate::SimError;

/// Refuses `value` unless it is finite.
pub(crate) fn finite(field: impl Display, value: f64) -> Result<(), SimError> {
    require(value.is_finite(), field, value, "finite")
}

/// Refuses `value` unless it is finite and above zero.
pub(crate) fn positive(field: impl Display, value: f64) -> Result<(), SimError> {
    require(value > 0.0 && value.is_finite(), field, value, "a positive number")
}

/// Refuses `value` unless it is finite and not below zero.
pub(crate) fn not_negative(field: impl Display, value: f64) -> Result<(), SimError> {
    require(value >= 0.0 && value.is_finite(), field, value, "zero or a positive number")
}

/// Refuses `value` unless it is in [0, 1].
pub(crate) fn probability(field: impl Display, value: f64) -> Result<(), SimError> {
    require((0.0..=1.0).contains(&value), field, value, "a probability, from 0 to 1")
}

/// Refuses `value` unless it is in `range`, which `requirement` tells.
pub(crate) fn in_range(
    field: impl Display,
    value: f64,
    range: std::ops::RangeInclusive<f64>,
    requirement: &'static str,
) -> Result<(), SimError> {
    require(range.contains(&value), field, value, requirement)
}

fn require(
    holds: bool,
    field: impl Display,
    value: f64,
    requirement: &'static str,
) -> Result<(), SimError> {
    if holds {
        Ok(())
    } else {
        Err(SimError::Field { field: field.to_string(), value, requirement })
    }
}
