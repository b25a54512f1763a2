/// A count as a number.
#[expect(clippy::cast_precision_loss, reason = "nothing counted here comes near 2⁵²")]
pub(crate) fn number(count: usize) -> f64 {
    count as f64
}
