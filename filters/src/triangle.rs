//! Square roots of sums of squares, and what is worked out with them.
//!
//! Rows and columns are made orthogonal by Gram and Schmidt's process in its modified form, whose
//! triangular factor has the backward error of Householder's (Björck 1967; Higham 2002, §19.8):
//! no square is subtracted, and no root waits for another.

use nalgebra::{SMatrix, SVector};

/// The lower triangular L with L Lᵀ = Σ W Wᵀ over the blocks W; no diagonal is negative, and where
/// the sum is singular some are zero.
#[inline]
pub(crate) fn lower_root<const D: usize, const K: usize, const B: usize>(
    mut blocks: [SMatrix<f64, D, K>; B],
) -> SMatrix<f64, D, D> {
    let mut root = SMatrix::<f64, D, D>::zeros();
    for k in 0..D {
        let square = dot(&blocks, k, k);
        // Where nothing is left of the row. A NaN is not caught here: it must come out.
        let (pivot, length) = match square <= 0.0 {
            true => (1.0, 1.0),
            false => (square, libm::sqrt(square)),
        };
        root[(k, k)] = square;
        for i in k + 1..D {
            root[(i, k)] = dot(&blocks, k, i);
            let along = root[(i, k)] / pivot;
            for block in &mut blocks {
                for column in 0..K {
                    block[(i, column)] -= along * block[(k, column)];
                }
            }
        }
        // A column at once, as it is stored: what is stored in parts is slow to be read as a whole.
        root.column_mut(k).unscale_mut(length);
    }
    root
}

/// The product of two rows of all blocks.
#[inline]
fn dot<const D: usize, const K: usize, const B: usize>(
    blocks: &[SMatrix<f64, D, K>; B],
    a: usize,
    b: usize,
) -> f64 {
    let mut sum = 0.0;
    for block in blocks {
        for column in 0..K {
            sum += block[(a, column)] * block[(b, column)];
        }
    }
    sum
}

/// Moments of ξ ~ N(0, I) given e = B ξ + white noise.
#[derive(Clone, Copy)]
pub(crate) struct Conditioned<const N: usize> {
    /// The mean of ξ.
    pub mean: SVector<f64, N>,
    /// T, lower triangular with a unit diagonal: T D⁻¹ Tᵀ is the covariance of ξ.
    pub factor: SMatrix<f64, N, N>,
    /// √D, at least 1; the square of their product is |I + B Bᵀ|.
    pub roots: SVector<f64, N>,
    /// eᵀ (I + B Bᵀ)⁻¹ e.
    pub square: f64,
}

impl<const N: usize> Conditioned<N> {
    /// Least squares of ξ = 0 and B ξ = e (Björck 1967): the columns of I over B are made
    /// orthogonal from the last to the first, so that what becomes of I is lower triangular, and 0
    /// over e is left with what they do not explain, −ξ over e − B ξ.
    #[inline]
    pub(crate) fn on<const M: usize>(mut b: SMatrix<f64, M, N>, mut e: SVector<f64, M>) -> Self {
        let mut factor = SMatrix::<f64, N, N>::identity();
        let mut mean = SVector::<f64, N>::zeros();
        let mut roots = SVector::zeros();
        for k in (0..N).rev() {
            let top = factor.column(k).into_owned();
            let below = b.column(k).into_owned();
            let square = top.norm_squared() + below.norm_squared();
            for j in 0..k {
                let mut along = below.dot(&b.column(j));
                for i in k + 1..N {
                    along += top[i] * factor[(i, j)];
                }
                along /= square;
                for i in k..N {
                    factor[(i, j)] -= along * top[i];
                }
                for i in 0..M {
                    b[(i, j)] -= along * below[i];
                }
            }
            let along = (below.dot(&e) - top.dot(&mean)) / square;
            mean += top * along;
            e -= below * along;
            roots[k] = libm::sqrt(square);
        }
        Self { mean, factor, roots, square: mean.norm_squared() + e.norm_squared() }
    }
}

/// The Cholesky factor of a covariance, of which the lower triangle is read; `None` where a pivot
/// is not positive. No pivot waits for the root of another.
#[inline]
pub(crate) fn cholesky<const D: usize>(mut p: SMatrix<f64, D, D>) -> Option<SMatrix<f64, D, D>> {
    for k in 0..D {
        let inverse = eliminate(&mut p, k);
        let root = libm::sqrt(p[(k, k)]);
        if root.is_nan() || root <= 0.0 {
            return None;
        }
        p[(k, k)] = root;
        let scale = root * inverse;
        (k + 1..D).for_each(|i| p[(i, k)] *= scale);
        (0..k).for_each(|i| p[(i, k)] = 0.0);
    }
    Some(p)
}

/// Returns true if each pivot of a covariance, of which the lower triangle is read, exceeds its
/// bound.
#[inline]
pub(crate) fn pivots_exceed<const D: usize>(
    mut p: SMatrix<f64, D, D>,
    bounds: &SVector<f64, D>,
) -> bool {
    let mut all = true;
    for k in 0..D {
        all &= p[(k, k)] > bounds[k];
        eliminate(&mut p, k);
    }
    all
}

/// Takes from the rows after the k-th what they share with it; 1 / its pivot.
#[inline(always)]
fn eliminate<const D: usize>(p: &mut SMatrix<f64, D, D>, k: usize) -> f64 {
    let inverse = 1.0 / p[(k, k)];
    for j in k + 1..D {
        let along = p[(j, k)] * inverse;
        (j..D).for_each(|i| p[(i, j)] -= along * p[(i, k)]);
    }
    inverse
}

/// 0 where every number is finite, else NaN: a sum, where a branch for each number costs more.
#[inline]
pub(crate) fn nan_unless_finite<const R: usize, const C: usize>(
    matrix: &SMatrix<f64, R, C>,
) -> f64 {
    matrix.iter().map(|value| value * 0.0).sum()
}

/// L Lᵀ of a lower triangular L, symmetric to the bit.
#[inline]
pub(crate) fn square<const D: usize>(l: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    SMatrix::from_fn(|i, j| (0..=i.min(j)).map(|k| l[(i, k)] * l[(j, k)]).sum())
}

/// L K of two lower triangular matrices.
#[inline]
pub(crate) fn product<const D: usize>(
    l: &SMatrix<f64, D, D>,
    k: &SMatrix<f64, D, D>,
) -> SMatrix<f64, D, D> {
    let mut product = SMatrix::<f64, D, D>::zeros();
    for j in 0..D {
        for i in j..D {
            for m in j..=i {
                product[(i, j)] += l[(i, m)] * k[(m, j)];
            }
        }
    }
    product
}

/// L⁻¹ Y of a lower triangular L. On few dimensions nalgebra's own, over views of lengths known at
/// run time, takes several times as long.
#[inline]
pub(crate) fn solve_lower<const D: usize, const C: usize>(
    l: &SMatrix<f64, D, D>,
    mut y: SMatrix<f64, D, C>,
) -> SMatrix<f64, D, C> {
    for i in 0..D {
        let inverse = 1.0 / l[(i, i)];
        for c in 0..C {
            for j in 0..i {
                y[(i, c)] -= l[(i, j)] * y[(j, c)];
            }
            y[(i, c)] *= inverse;
        }
    }
    y
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

    use super::*;

    const COLUMNS: Matrix3<f64> = Matrix3::new(1.0, 0.0, -4.0, -2.0, 3.0, 0.1, 0.5, 1.0, 2.0);

    #[test]
    fn a_root_is_one_of_the_sum() {
        let more = Matrix3::from_diagonal_element(0.5);
        let root = lower_root([COLUMNS, more]);
        let sum = COLUMNS * COLUMNS.transpose() + more * more;
        // Ten roundings of numbers up to 16.
        assert!((square(&root) - sum).norm() < 1e-13);
        assert!((root - root.lower_triangle()).norm() <= 0.0);
        assert!(root.diagonal().iter().all(|d| *d > 0.0));
        // What is singular has one, too, as has nothing.
        let column = Vector3::new(0.0, -2.0, 1.0);
        let root = lower_root([column]);
        assert!((square(&root) - column * column.transpose()).norm() < 1e-15);
        assert!(lower_root([Matrix3::<f64>::zeros(); 2]).norm() <= 0.0);
    }

    #[test]
    fn a_thin_direction_survives_a_huge_column() {
        let huge =
            Matrix3::from_columns(&[Vector3::repeat(1e12), Vector3::zeros(), Vector3::zeros()]);
        let root = lower_root([Matrix3::identity(), huge]);
        // det(I + w wᵀ) = 1 + |w|²: in the covariance's own numbers the 1 would be lost.
        let determinant: f64 = root.diagonal().iter().product();
        assert_abs_diff_eq!(determinant / (libm::sqrt(3.0) * 1e12), 1.0, epsilon = 1e-3);
    }

    #[test]
    fn nan_comes_out() {
        let column = Vector3::new(0.0, f64::NAN, 0.0);
        assert!(
            lower_root([Matrix3::identity(), Matrix3::from_diagonal(&column)])[(1, 1)].is_nan()
        );
        assert!(nan_unless_finite(&column).is_nan());
        assert!(nan_unless_finite(&Vector2::new(f64::MAX, f64::INFINITY)).is_nan());
        assert!(!nan_unless_finite(&Vector2::new(f64::MAX, f64::MAX)).is_nan());
    }

    #[test]
    fn conditioning_is_that_of_the_covariances() {
        // From hardly observed to a hundred million times as well as before.
        for scale in [1e-3, 1.0, 1e4] {
            let b = Matrix2x3::new(1.0, -0.3, 0.2, 0.4, 2.0, -1.0) * scale;
            let e = Vector2::new(0.7, -1.3) * scale;
            let Conditioned { mean, factor, roots, square: nis } = Conditioned::on(b, e);
            let innovation = b * b.transpose() + Matrix2::identity();
            let inverse = innovation.try_inverse().expect("definite");
            let room = 1e-15 * (1.0 + scale * scale);
            assert!((mean - b.transpose() * inverse * e).norm() < 10.0 * room);
            let covariance = Matrix3::identity() - b.transpose() * inverse * b;
            let scaled = factor * Matrix3::from_diagonal(&roots.map(|root| 1.0 / root));
            assert!((square(&scaled) - covariance).norm() < 10.0 * room);
            assert!((factor - factor.lower_triangle()).norm() <= 0.0);
            assert_abs_diff_eq!(nis, (e.transpose() * inverse * e)[0], epsilon = 10.0 * room);
            let determinant = roots.iter().product::<f64>().powi(2) / innovation.determinant();
            assert_abs_diff_eq!(determinant, 1.0, epsilon = 10.0 * room);
        }
    }

    #[test]
    fn what_is_measured_sharply_is_known_to_the_last_digits() {
        // One sum of both components, to a 10⁹th: half of it each, and their difference as before.
        let b = nalgebra::RowVector2::new(1e9, 1e9);
        let known = Conditioned::on(b, nalgebra::Vector1::new(1e9));
        assert!((known.mean - Vector2::repeat(0.5)).norm() < 1e-15);
        let factor = known.factor * Matrix2::from_diagonal(&known.roots.map(|root| 1.0 / root));
        assert!((square(&factor) - Matrix2::new(0.5, -0.5, -0.5, 0.5)).norm() < 1e-14);
        assert_abs_diff_eq!(known.square, 0.5, epsilon = 1e-14);
    }

    #[test]
    fn products_and_quotients_are_those_of_the_whole_matrices() {
        let lower = Matrix3::new(2.0, 0.0, 0.0, -1.0, 0.5, 0.0, 3.0, 0.7, 4.0);
        assert!((lower * solve_lower(&lower, COLUMNS) - COLUMNS).norm() < 1e-14);
        let other = COLUMNS.lower_triangle();
        assert!((product(&lower, &other) - lower * other).norm() < 1e-15);
    }
}
