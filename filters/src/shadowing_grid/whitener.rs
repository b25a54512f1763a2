use alloc::vec::Vec;

use foxhunt_core::Pose;
use nalgebra::DMatrix;

/// How many right-hand sides are solved side by side: their sums fill the vector registers, and
/// 300 rows of them about the first-level cache. Faster than a column at a time.
pub(super) const LANES: usize = 16;

/// One row of [`LANES`] right-hand sides.
pub(super) type Row = [f64; LANES];

/// The Cholesky factor L of the readings' correlation, C = L Lᵀ.
#[derive(Clone, Debug)]
pub(super) struct Whitener {
    /// The rows of L up to the diagonal, one behind the other.
    rows: Vec<f64>,
    /// ½ ln |C|.
    half_log_determinant: f64,
}

impl Whitener {
    /// Factors `C_ij = (1 − nugget) exp(−D_ij/ℓ) + nugget δ_ij`, D the distance
    /// (Gudmundson 1991); `None` where C is not positive definite.
    pub(super) fn new(receivers: &[Pose], length_m: f64, nugget: f64) -> Option<Self> {
        let n = receivers.len();
        let correlation = DMatrix::from_fn(n, n, |i, j| {
            if i == j {
                return 1.0;
            }
            let apart_m = (receivers[i].position - receivers[j].position).norm();
            (1.0 - nugget) * libm::exp(-apart_m / length_m)
        });
        let factor = correlation.cholesky()?.unpack();
        let rows = (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))).map(|at| factor[at]).collect();
        let half_log_determinant = factor.diagonal().iter().copied().map(libm::log).sum();
        Some(Self { rows, half_log_determinant })
    }

    /// ½ ln |C|.
    pub(super) fn half_log_determinant(&self) -> f64 {
        self.half_log_determinant
    }

    /// Replaces X by L⁻¹ X, by forward substitution.
    pub(super) fn whiten(&self, x: &mut [Row]) {
        let mut rest = self.rows.as_slice();
        for i in 0..x.len() {
            let (row, after) = rest.split_at(i + 1);
            rest = after;
            let (solved, open) = x.split_at_mut(i);
            let (Some(target), Some(diagonal)) = (open.first_mut(), row.last()) else { return };
            let mut sum = *target;
            for (l, known) in row.iter().zip(&*solved) {
                for (sum, known) in sum.iter_mut().zip(known) {
                    *sum -= l * known;
                }
            }
            *target = sum.map(|sum| sum / diagonal);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whitened_product_is_that_of_the_inverse_correlation() {
        let receivers: Vec<_> = [(0.0, 0.0), (10.0, 5.0), (40.0, -3.0), (12.0, 5.0), (0.0, 30.0)]
            .map(|(east, north)| Pose::at(east, north, 20.0 + east))
            .to_vec();
        let whitener = Whitener::new(&receivers, 25.0, 0.2).expect("positive definite");
        let mut x = [[0.0; LANES]; 5];
        for (phase, entry) in (0..80_u8).zip(x.as_flattened_mut()) {
            *entry = libm::sin(0.7 * f64::from(phase) + 0.1 * f64::from(phase % 7));
        }
        // Written out anew, from the model's definition.
        let c = DMatrix::from_fn(5, 5, |i, j| {
            let apart = receivers[i].position - receivers[j].position;
            let apart_m = libm::sqrt(apart.dot(&apart));
            0.8 * libm::exp(-apart_m / 25.0) + if i == j { 0.2 } else { 0.0 }
        });
        let dense = DMatrix::from_fn(5, LANES, |i, k| x[i][k]);
        let expected = dense.transpose() * c.clone().lu().solve(&dense).expect("regular");
        whitener.whiten(&mut x);
        let white = DMatrix::from_fn(5, LANES, |i, k| x[i][k]);
        assert!((white.transpose() * white - expected).norm() < 1e-12);
        assert!((2.0 * whitener.half_log_determinant() - libm::log(c.determinant())).abs() < 1e-12);
    }

    #[test]
    fn coinciding_places_need_a_nugget() {
        let receivers = [Pose::at(1.0, 2.0, 3.0); 2];
        assert!(Whitener::new(&receivers, 25.0, 0.0).is_none());
        assert!(Whitener::new(&receivers, 25.0, 0.1).is_some());
    }
}
