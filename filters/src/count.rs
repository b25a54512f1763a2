/// A count as a number.
#[expect(clippy::cast_precision_loss, reason = "nothing counted here comes near 2⁵²")]
pub(crate) fn number(count: usize) -> f64 {
    count as f64
}

/// The middle value, or the mean of the middle two, of values in any order; `None` of nothing.
#[cfg(feature = "alloc")]
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let half = values.len() / 2;
    let upper = *values.get(half)?;
    let lower = if values.len().is_multiple_of(2) { values.get(half - 1) } else { None };
    Some(lower.map_or(upper, |lower| 0.5 * (lower + upper)))
}
