/// A parameter of a planner or a shape that is out of its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{field} is {value}; it must be {must}")]
pub struct ParameterError {
    /// Which one.
    pub field: &'static str,
    /// What it held.
    pub value: f64,
    /// What it must be.
    pub must: &'static str,
}

/// A finite number.
pub(crate) fn finite(field: &'static str, value: f64) -> Result<(), ParameterError> {
    check(field, value, "finite", value.is_finite())
}

/// A finite number above 0: a length, a factor.
pub(crate) fn positive(field: &'static str, value: f64) -> Result<(), ParameterError> {
    check(field, value, "finite and positive", value.is_finite() && value > 0.0)
}

/// A finite number that is not below 0.
pub(crate) fn not_negative(field: &'static str, value: f64) -> Result<(), ParameterError> {
    check(field, value, "finite and not negative", value.is_finite() && value >= 0.0)
}

/// A count of at least 1.
pub(crate) fn counted(field: &'static str, value: u32) -> Result<(), ParameterError> {
    check(field, f64::from(value), "at least 1", value > 0)
}

/// What must hold, in words and as found.
pub(crate) fn check(
    field: &'static str,
    value: f64,
    must: &'static str,
    holds: bool,
) -> Result<(), ParameterError> {
    if holds { Ok(()) } else { Err(ParameterError { field, value, must }) }
}
