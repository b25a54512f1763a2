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
