use std::fmt::Display;

use crate::SimError;

/// Refuses `value` unless it is finite.
pub(super) fn finite(field: impl Display, value: f64) -> Result<(), SimError> {
    require(value.is_finite(), field, value, "finite")
}

/// Refuses `value` unless it is finite and above zero.
pub(super) fn positive(field: impl Display, value: f64) -> Result<(), SimError> {
    require(value > 0.0 && value.is_finite(), field, value, "a positive number")
}

/// Refuses `value` unless it is finite and not below zero.
pub(super) fn not_negative(field: impl Display, value: f64) -> Result<(), SimError> {
    require(value >= 0.0 && value.is_finite(), field, value, "zero or a positive number")
}

/// Refuses `value` unless it is in [0, 1].
pub(super) fn probability(field: impl Display, value: f64) -> Result<(), SimError> {
    require((0.0..=1.0).contains(&value), field, value, "a probability, from 0 to 1")
}

/// Refuses `value` unless it is finite, above zero and at most `most`.
pub(super) fn at_most(
    field: impl Display,
    value: f64,
    most: f64,
    requirement: &'static str,
) -> Result<(), SimError> {
    require(value > 0.0 && value <= most, field, value, requirement)
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
