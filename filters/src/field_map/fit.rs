use alloc::vec::Vec;

use faer::Mat;
use nalgebra::Vector2;

use super::{
    config::FieldModel,
    covariance::{Correlation, column, dot},
};
use crate::count::number;

/// A field given its readings, for one choice of hyperparameters.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) correlation: Correlation,
    pub(super) model: FieldModel,
    /// L⁻¹ (y − β 1).
    pub(super) residual: Vec<f64>,
    /// ln p(y | ℓ, ν) with β and σ integrated out, but for a constant.
    pub(super) log_likelihood: f64,
}

impl Fit {
    /// The mean β has a flat prior and σ the prior 1/σ; both are integrated out of the likelihood
    /// |C|^−½ (u·u)^−½ SSR^(−(n−1)/2) with u = L⁻¹ 1 (Handcock & Stein 1993, eq. 8); `None` where C
    /// has no factor or the readings no spread.
    pub(super) fn new(
        places: &[Vector2<f64>],
        values: &[f64],
        length_m: f64,
        noise_share: f64,
    ) -> Option<Self> {
        let correlation = Correlation::new(places, length_m, noise_share)?;
        let mut white = Mat::<f64>::from_fn(values.len(), 1, |i, _| values[i]);
        correlation.whiten(&mut white);
        let mut residual = column(&white, 0);
        let ones = dot(&correlation.ones, &correlation.ones);
        let mean = dot(&correlation.ones, &residual) / ones;
        for (residual, one) in residual.iter_mut().zip(&correlation.ones) {
            *residual -= mean * one;
        }
        let squares = dot(&residual, &residual);
        let freedom = number(values.len()) - 1.0;
        let log_likelihood = -correlation.half_log_determinant()
            - 0.5 * libm::log(ones)
            - 0.5 * freedom * libm::log(squares);
        let sigma = libm::sqrt(squares / freedom);
        let model = FieldModel { length_m, noise_share, sigma, mean };
        let proper = log_likelihood.is_finite() && sigma > 0.0;
        proper.then_some(Self { correlation, model, residual, log_likelihood })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    /// The likelihood is the density of contrasts, which know nothing of the mean; written out
    /// again with Helmert's.
    #[test]
    fn the_likelihood_is_that_of_the_contrasts() {
        let places: Vec<Vector2<f64>> =
            [(0.0, 0.0), (30.0, 5.0), (70.0, -20.0), (10.0, 60.0), (55.0, 41.0)]
                .map(|(east, north)| Vector2::new(east, north))
                .to_vec();
        let values = [3.0, -1.0, 4.0, 1.5, -5.0];
        let n = places.len();
        let helmert = DMatrix::from_fn(n - 1, n, |i, j| {
            let k = number(i + 1);
            let size = libm::sqrt(k * (k + 1.0));
            if j <= i {
                1.0 / size
            } else if j == i + 1 {
                -k / size
            } else {
                0.0
            }
        });
        let contrasts = &helmert * DVector::from_row_slice(&values);
        let oracle = |length_m: f64, share: f64| {
            let c = DMatrix::from_fn(n, n, |i, j| {
                let scaled = libm::sqrt(3.0) * (places[i] - places[j]).norm() / length_m;
                let own = if i == j { share } else { 0.0 };
                (1.0 - share) * (1.0 + scaled) * libm::exp(-scaled) + own
            });
            let c = &helmert * c * helmert.transpose();
            let squares = contrasts.dot(&c.clone().lu().solve(&contrasts).expect("regular"));
            -0.5 * libm::log(c.determinant()) - 0.5 * number(n - 1) * libm::log(squares)
        };
        let fit = |length_m: f64, share: f64| {
            Fit::new(&places, &values, length_m, share).expect("regular").log_likelihood
        };
        let first = fit(20.0, 0.1) - oracle(20.0, 0.1);
        for (length_m, share) in [(80.0, 0.1), (300.0, 0.5), (40.0, 0.9)] {
            let error = fit(length_m, share) - oracle(length_m, share) - first;
            assert!(error.abs() < 1e-10, "off by {error} at {length_m} m, {share}");
        }
    }
}
