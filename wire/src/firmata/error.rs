/// Error of a message that cannot be put into bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field} is {value}; Firmata has room for {least} to {most}")]
pub struct FirmataError {
    /// Name of the field that does not fit.
    pub field: &'static str,
    /// Value of the field.
    pub value: i64,
    /// The least that fits.
    pub least: i64,
    /// The most that fits.
    pub most: i64,
}

/// `value`, if it is at most `most`.
pub(super) fn at_most(field: &'static str, value: u8, most: u8) -> Result<u8, FirmataError> {
    if value <= most {
        return Ok(value);
    }
    Err(FirmataError { field, value: value.into(), least: 0, most: most.into() })
}
