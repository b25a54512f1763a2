use core::f64::consts::PI;

use nalgebra::{Matrix2, Vector2};

/// `count` places of equal weight that lie as a Gaussian has them, on a spiral whose turns are
/// golden angles (Vogel 1979); `factor` is the Cholesky factor of its covariance.
pub(crate) fn spiral(
    mean: Vector2<f64>,
    factor: Matrix2<f64>,
    count: u32,
) -> impl Iterator<Item = Vector2<f64>> {
    let golden = PI * (3.0 - libm::sqrt(5.0));
    (0..count).map(move |index| {
        let share = (f64::from(index) + 0.5) / f64::from(count);
        let radius = libm::sqrt(-2.0 * libm::log1p(-share));
        let angle = golden * f64::from(index);
        mean + factor * Vector2::new(libm::cos(angle), libm::sin(angle)) * radius
    })
}
