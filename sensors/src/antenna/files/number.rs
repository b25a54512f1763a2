use super::{PatternFileError, PatternFileReason};

/// The finite number in `text`.
pub(super) fn number(
    line: usize,
    field: &'static str,
    text: &str,
) -> Result<f64, PatternFileError> {
    let read = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    read.ok_or_else(|| PatternFileReason::NotANumber { field, value: text.trim().into() }.at(line))
}
