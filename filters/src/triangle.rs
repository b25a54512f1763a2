//! Sums of squares in factored form.
//!
//! F Fᵀ + w wᵀ is formed by rotating the column w into the triangular F, one Givens rotation a
//! row (Golub & Van Loan 2013, §5.1.8 and §6.5.4): orthogonal, so nothing cancels, and F may be
//! singular, even zero.

use nalgebra::{SMatrix, SVector};

/// Makes the lower triangular L that of L Lᵀ + w wᵀ; its diagonal stays non-negative.
pub(crate) fn add_to_lower<const D: usize>(l: &mut SMatrix<f64, D, D>, mut w: SVector<f64, D>) {
    for k in 0..D {
        rotate_in(l, &mut w, k, k + 1..D);
    }
}

/// Makes the upper triangular U that of U Uᵀ + w wᵀ; its diagonal stays non-negative.
pub(crate) fn add_to_upper<const D: usize>(u: &mut SMatrix<f64, D, D>, mut w: SVector<f64, D>) {
    for k in (0..D).rev() {
        rotate_in(u, &mut w, k, 0..k);
    }
}

/// Turns column `k` of `f` against `w` so that `w[k]` vanishes; `rest` are the rows still open.
fn rotate_in<const D: usize>(
    f: &mut SMatrix<f64, D, D>,
    w: &mut SVector<f64, D>,
    k: usize,
    rest: core::ops::Range<usize>,
) {
    let length = libm::sqrt(f[(k, k)] * f[(k, k)] + w[k] * w[k]);
    // Nothing to turn. A NaN is not caught here: it must come out.
    if length <= 0.0 {
        return;
    }
    let (cos, sin) = (f[(k, k)] / length, w[k] / length);
    f[(k, k)] = length;
    for i in rest {
        let (old, out) = (f[(i, k)], w[i]);
        f[(i, k)] = cos * old + sin * out;
        w[i] = cos * out - sin * old;
    }
}

/// F Fᵀ, symmetric to the bit.
pub(crate) fn square<const D: usize>(f: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    let mut square = f * f.transpose();
    square.fill_upper_triangle_with_lower_triangle();
    square
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;

    #[test]
    fn a_rotated_column_is_added_to_the_square() {
        let columns = [
            Vector3::new(1.0, -2.0, 0.5),
            Vector3::new(0.0, 3.0, 1.0),
            Vector3::new(-4.0, 0.1, 2.0),
        ];
        let (mut lower, mut upper) = (Matrix3::zeros(), Matrix3::zeros());
        let mut sum = Matrix3::zeros();
        for column in columns {
            add_to_lower(&mut lower, column);
            add_to_upper(&mut upper, column);
            sum += column * column.transpose();
            // Ten roundings of numbers up to 16.
            assert!((square(&lower) - sum).norm() < 1e-13);
            assert!((upper * upper.transpose() - sum).norm() < 1e-13);
        }
        assert!(lower.upper_triangle().iter().zip(&lower.diagonal()).all(|(_, d)| *d > 0.0));
        assert!((lower - lower.lower_triangle()).norm() <= 0.0);
        assert!((upper - upper.upper_triangle()).norm() <= 0.0);
    }

    #[test]
    fn a_thin_direction_survives_a_huge_column() {
        let mut lower = Matrix3::identity();
        add_to_lower(&mut lower, Vector3::new(1e12, 1e12, 1e12));
        // det(I + w wᵀ) = 1 + |w|²: in the covariance's own numbers the 1 would be lost.
        let determinant: f64 = lower.diagonal().iter().product();
        assert!((determinant / (libm::sqrt(3.0) * 1e12) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn nan_comes_out() {
        let mut lower = Matrix3::identity();
        add_to_lower(&mut lower, Vector3::new(0.0, f64::NAN, 0.0));
        assert!(lower[(1, 1)].is_nan());
    }
}
