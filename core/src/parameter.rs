//! Checks of parameters, and the one error that they end in.

use core::ops::RangeInclusive;

/// A parameter that is out of its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} is {value}; it must be {requirement}")]
pub struct ParameterError {
    /// The parameter's name.
    pub name: &'static str,
    /// The refused value.
    pub value: f64,
    /// The requirement that the value does not meet.
    pub requirement: &'static str,
}

/// Refuses `value` unless `holds`, which `requirement` puts in words.
///
/// # Errors
///
/// [`ParameterError`] where it does not hold.
pub fn require(
    holds: bool,
    name: &'static str,
    value: f64,
    requirement: &'static str,
) -> Result<f64, ParameterError> {
    if holds { Ok(value) } else { Err(ParameterError { name, value, requirement }) }
}

/// Refuses a value that is not finite.
///
/// # Errors
///
/// [`ParameterError`] for NaN and infinities.
pub fn finite(name: &'static str, value: f64) -> Result<f64, ParameterError> {
    require(value.is_finite(), name, value, "finite")
}

/// Refuses a value that is not finite and above zero.
///
/// # Errors
///
/// [`ParameterError`] for anything else.
pub fn positive(name: &'static str, value: f64) -> Result<f64, ParameterError> {
    require(value > 0.0 && value.is_finite(), name, value, "a positive number")
}

/// Refuses a value that is not finite or is below zero.
///
/// # Errors
///
/// [`ParameterError`] for anything else.
pub fn not_negative(name: &'static str, value: f64) -> Result<f64, ParameterError> {
    require(value >= 0.0 && value.is_finite(), name, value, "zero or a positive number")
}

/// Refuses a value that is not in [0, 1].
///
/// # Errors
///
/// [`ParameterError`] for anything else.
pub fn probability(name: &'static str, value: f64) -> Result<f64, ParameterError> {
    in_range(name, value, 0.0..=1.0, "a probability, from 0 to 1")
}

/// Refuses a value that is not in `range`, which `requirement` puts in words.
///
/// # Errors
///
/// [`ParameterError`] for anything else, NaN included.
pub fn in_range(
    name: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
    requirement: &'static str,
) -> Result<f64, ParameterError> {
    require(range.contains(&value), name, value, requirement)
}

/// Refuses a count of zero.
///
/// # Errors
///
/// [`ParameterError`] for zero.
pub fn at_least_one(name: &'static str, count: u32) -> Result<u32, ParameterError> {
    require(count > 0, name, f64::from(count), "at least 1").map(|_| count)
}

/// A count as the number that an error holds; exact below 2⁵³.
#[must_use]
pub fn as_value(count: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "an error message needs no more digits")]
    let value = count as f64;
    value
}

/// A field of a configuration that is out of its range: its place in the file, and the value
/// written there.
#[cfg(feature = "alloc")]
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{field} is {value}; it must be {requirement}")]
pub struct FieldError {
    /// Path of the field, as names and indices: `drones[2].north_m`.
    pub field: alloc::string::String,
    /// The refused value.
    pub value: alloc::string::String,
    /// The requirement that the value does not meet.
    pub requirement: &'static str,
}

#[cfg(feature = "alloc")]
impl ParameterError {
    /// Returns the error with the parameter's place in a table or list of a configuration, such as
    /// `drones[2]`.
    #[must_use]
    pub fn within(self, table: impl core::fmt::Display) -> FieldError {
        FieldError { field: alloc::format!("{table}.{}", self.name), ..FieldError::from(self) }
    }
}

#[cfg(feature = "alloc")]
impl From<ParameterError> for FieldError {
    fn from(error: ParameterError) -> Self {
        use alloc::string::ToString;
        let ParameterError { name, value, requirement } = error;
        Self { field: name.to_string(), value: value.to_string(), requirement }
    }
}

#[cfg(feature = "alloc")]
impl FieldError {
    /// A field of any type.
    pub fn new(
        field: impl Into<alloc::string::String>,
        value: impl core::fmt::Display,
        requirement: &'static str,
    ) -> Self {
        Self { field: field.into(), value: alloc::string::ToString::to_string(&value), requirement }
    }

    /// Returns the error with its field placed in `table`, a table of another configuration.
    #[must_use]
    pub fn within(self, table: impl core::fmt::Display) -> Self {
        Self { field: alloc::format!("{table}.{}", self.field), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_check_has_its_borders() {
        assert_eq!(finite("x", -1.0), Ok(-1.0));
        assert!(finite("x", f64::INFINITY).is_err());
        assert!(positive("x", 0.0).is_err() && positive("x", f64::INFINITY).is_err());
        assert_eq!(positive("x", 1e-300), Ok(1e-300));
        assert!(not_negative("x", 0.0).is_ok() && not_negative("x", -1e-300).is_err());
        assert!(probability("x", 0.0).is_ok() && probability("x", 1.0).is_ok());
        assert!(probability("x", 1.000_001).is_err() && probability("x", f64::NAN).is_err());
        assert!(at_least_one("x", 0).is_err() && at_least_one("x", 1).is_ok());
    }

    #[cfg(feature = "alloc")]
    #[test]
    fn an_error_names_the_field_the_value_and_the_requirement() {
        use alloc::string::ToString;
        let error = positive("rate_hz", f64::NAN).expect_err("not a number");
        assert_eq!(error.to_string(), "rate_hz is NaN; it must be a positive number");
        let nested = error.within("drones[2]").within("world");
        assert_eq!(
            nested.to_string(),
            "world.drones[2].rate_hz is NaN; it must be a positive number"
        );
        let empty = FieldError::new("beacons", "empty", "at least one");
        assert_eq!(empty.to_string(), "beacons is empty; it must be at least one");
    }
}
