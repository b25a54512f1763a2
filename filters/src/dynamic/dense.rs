//! Factorisations of matrices of any size, by nalgebra; with the feature `large-states` by faer
//! from `LARGE` dimensions on.

use nalgebra::DMatrix;

/// Number of dimensions from which faer is faster; `benches/joint.rs` measures both.
#[cfg(feature = "large-states")]
const LARGE: usize = 32;

/// The Cholesky factor of a covariance, of which the lower triangle is read; `None` where it is not
/// positive definite.
#[inline]
pub(super) fn cholesky(covariance: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    #[cfg(feature = "large-states")]
    if covariance.nrows() >= LARGE {
        return large::cholesky(covariance);
    }
    covariance.clone().cholesky().map(|factor| factor.unpack())
}

/// The lower triangular L with L Lᵀ = W Wᵀ, by Householder's reflections: no square is formed.
/// No diagonal is negative; where W Wᵀ is singular, some are zero.
#[inline]
pub(super) fn lower_root(mut block: DMatrix<f64>) -> DMatrix<f64> {
    let dimension = block.nrows();
    if block.ncols() < dimension {
        block = block.resize_horizontally(dimension, 0.0);
    }
    let mut root = upper(&block.transpose()).transpose();
    for mut column in
        root.column_iter_mut().enumerate().filter_map(|(i, c)| (c[i] < 0.0).then_some(c))
    {
        column.neg_mut();
    }
    root
}

/// R of the decomposition Q R of a matrix with at least as many rows as columns.
#[inline]
fn upper(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    #[cfg(feature = "large-states")]
    if matrix.ncols() >= LARGE {
        return large::upper(matrix);
    }
    matrix.clone().qr().r()
}

/// L⁻¹ Y of a lower triangular L; not finite where L has a zero on its diagonal.
#[inline]
pub(super) fn solve_lower(factor: &DMatrix<f64>, mut right: DMatrix<f64>) -> DMatrix<f64> {
    if !factor.solve_lower_triangular_mut(&mut right) {
        right.fill(f64::NAN);
    }
    right
}

/// L⁻ᵀ Y of a lower triangular L; not finite where L has a zero on its diagonal.
#[inline]
pub(super) fn solve_transposed(factor: &DMatrix<f64>, mut right: DMatrix<f64>) -> DMatrix<f64> {
    if !factor.tr_solve_lower_triangular_mut(&mut right) {
        right.fill(f64::NAN);
    }
    right
}

/// Takes H Hᵀ, with a row of H for each dimension, from the lower triangle of a covariance and
/// copies that to the upper one.
#[inline]
pub(super) fn subtract_square(covariance: &mut DMatrix<f64>, half: &DMatrix<f64>) {
    for (j, mut column) in covariance.column_iter_mut().enumerate() {
        let mut below = column.rows_range_mut(j..);
        for by in half.column_iter() {
            below.axpy(-by[j], &by.rows_range(j..), 1.0);
        }
    }
    covariance.fill_upper_triangle_with_lower_triangle();
}

/// Returns true if every number is finite.
pub(super) fn is_finite<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> bool {
    numbers.into_iter().all(|number| number.is_finite())
}

#[cfg(feature = "large-states")]
mod large {
    use faer::{
        Mat, MatRef, Side,
        linalg::solvers::{Llt, Qr},
    };
    use nalgebra::DMatrix;

    #[inline]
    pub(super) fn cholesky(covariance: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let factor = Llt::new(view(covariance), Side::Lower).ok()?;
        Some(triangle(factor.L(), true))
    }

    #[inline]
    pub(super) fn upper(matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let matrix: Mat<f64> = view(matrix).to_owned();
        triangle(Qr::new(matrix.as_ref()).thin_R(), false)
    }

    fn view(matrix: &DMatrix<f64>) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(matrix.as_slice(), matrix.nrows(), matrix.ncols())
    }

    /// A triangle of a square matrix; what faer leaves in the other one is not read.
    fn triangle(matrix: MatRef<'_, f64>, lower: bool) -> DMatrix<f64> {
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| match lower == (i >= j) || i == j {
            true => matrix[(i, j)],
            false => 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A covariance of n components that are correlated with their neighbours.
    fn covariance(n: usize) -> DMatrix<f64> {
        DMatrix::from_fn(n, n, |i, j| {
            let apart = f64::from(u32::try_from(i.abs_diff(j)).expect("few"));
            libm::exp(-0.3 * apart) + if i == j { 0.1 } else { 0.0 }
        })
    }

    #[test]
    fn factors_are_those_of_the_covariance_below_and_above_the_limit() {
        for n in [1, 5, 31, 32, 50] {
            let p = covariance(n);
            let factor = cholesky(&p).expect("definite");
            assert!((&factor * factor.transpose() - &p).norm() < 1e-13 * p.norm(), "{n}");
            assert!((factor.lower_triangle() - &factor).norm() <= 0.0, "{n}");
            let root = lower_root(factor.clone());
            assert!((&root - &factor).norm() < 1e-12 * p.norm(), "{n}");
            let mut wide = factor.clone().resize_horizontally(2 * n, 0.0);
            wide.columns_mut(n, n).copy_from(&(&factor * 2.0));
            let root = lower_root(wide);
            assert!((&root * root.transpose() - &p * 5.0).norm() < 1e-12 * p.norm(), "{n}");
            assert!(root.diagonal().iter().all(|d| *d > 0.0), "{n}");

            let mut indefinite = p.clone();
            indefinite[(n - 1, n - 1)] = -1.0;
            assert!(cholesky(&indefinite).is_none(), "{n}");
            let mut not_finite = p.clone();
            not_finite[(n - 1, 0)] = f64::NAN;
            assert!(cholesky(&not_finite).is_none(), "{n}");
        }
    }

    #[test]
    fn a_root_of_few_columns_is_singular() {
        for n in [3, 40] {
            let root = lower_root(DMatrix::repeat(n, 1, 2.0));
            let square = &root * root.transpose();
            assert!((square - DMatrix::repeat(n, n, 4.0)).norm() < 1e-12, "{n}");
        }
    }

    #[test]
    fn a_square_is_taken_from_both_triangles() {
        let p = covariance(4);
        let half = DMatrix::from_fn(4, 2, |i, j| if i == j { 0.3 } else { 0.1 });
        let mut less = p.clone();
        subtract_square(&mut less, &half);
        assert!((less - (p - &half * half.transpose())).norm() < 1e-15);
    }
}
