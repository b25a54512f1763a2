/// Why a model, an extractor or a source could not be made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterError {
    /// A number is out of its range.
    #[error("{name} is {value}; it must be {requirement}")]
    Value {
        /// What the parameter is called.
        name: &'static str,
        /// What it was.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// A count is out of its range.
    #[error("{name} is {value}; it must be {requirement}")]
    Count {
        /// What the parameter is called.
        name: &'static str,
        /// What it was.
        value: u16,
        /// What it must be.
        requirement: &'static str,
    },
}

/// `value`, if it is finite.
pub(crate) fn finite(name: &'static str, value: f64) -> Result<f64, ParameterError> {
    require(value.is_finite(), name, value, "finite")
}

/// `value`, if it is finite and above zero.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<f64, ParameterError> {
    require(value > 0.0 && value.is_finite(), name, value, "a positive number")
}

/// `value`, if it is finite and not below zero.
pub(crate) fn not_negative(name: &'static str, value: f64) -> Result<f64, ParameterError> {
    require(value >= 0.0 && value.is_finite(), name, value, "zero or a positive number")
}

/// `value`, if `holds`.
pub(crate) fn require(
    holds: bool,
    name: &'static str,
    value: f64,
    requirement: &'static str,
) -> Result<f64, ParameterError> {
    if holds { Ok(value) } else { Err(ParameterError::Value { name, value, requirement }) }
}

/// `value`, if `holds`.
pub(crate) fn require_count(
    holds: bool,
    name: &'static str,
    value: u16,
    requirement: &'static str,
) -> Result<u16, ParameterError> {
    if holds { Ok(value) } else { Err(ParameterError::Count { name, value, requirement }) }
}
