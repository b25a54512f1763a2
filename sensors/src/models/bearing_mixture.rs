use core::f64::consts::{PI, TAU};

use foxhunt_core::{
    angle,
    parameter::{self, ParameterError},
};

/// How bearings err indoors: f(e) = (1 − p₀) N(e; μ, σ²) + p₀/2π over one turn (Isaacs et al. 2014,
/// eq. 30).
///
/// The density uses μ, although the text calls the error zero-mean. σ is meant to be small
/// against π: the normal's tails beyond half a turn are not wrapped round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingMixture {
    outlier_share: f64,
    bias: f64,
    sigma: f64,
}

impl BearingMixture {
    /// The density with the share p₀ of outliers, the bias μ and the deviation σ in radians.
    ///
    /// # Errors
    ///
    /// Names the share that is not in [0, 1), the bias that is not finite or the σ that is not
    /// positive.
    pub fn new(outlier_share: f64, bias: f64, sigma: f64) -> Result<Self, ParameterError> {
        let valid = (0.0..1.0).contains(&outlier_share);
        Ok(Self {
            outlier_share: parameter::require(valid, "outlier_share", outlier_share, "in [0, 1)")?,
            bias: parameter::finite("bias", bias)?,
            sigma: parameter::positive("sigma", sigma)?,
        })
    }

    /// p₀ = 0.19, μ = 0.0929 rad, σ = 0.2468 rad (Isaacs et al. 2014, §IV).
    #[must_use]
    pub fn isaacs2014() -> Self {
        Self { outlier_share: 0.19, bias: 0.0929, sigma: 0.2468 }
    }

    /// The density of the error `e` in radians.
    #[must_use]
    pub fn density(&self, e: f64) -> f64 {
        self.about_bias(angle::wrap(e - self.bias)).0
    }

    /// The Fisher information of one bearing about its true direction, ∫ f′²/f de in rad⁻²;
    /// its inverse is the Cramér-Rao bound on the variance of an unbiased estimate.
    #[must_use]
    pub fn fisher_information(&self) -> f64 {
        // Beyond 12 σ the slope is below e⁻⁷² of its peak; between, the trapezoidal rule on a
        // smooth function that vanishes at both ends errs less than rounding.
        const INTERVALS: u16 = 4096;
        let reach = (12.0 * self.sigma).min(PI);
        let step = 2.0 * reach / f64::from(INTERVALS);
        let integrand = |i: u16| {
            let (f, slope) = self.about_bias(f64::from(i) * step - reach);
            if f > 0.0 { slope * slope / f } else { 0.0 }
        };
        (1..INTERVALS).map(integrand).sum::<f64>() * step
    }

    /// f and f′ at a distance from the bias.
    fn about_bias(&self, distance: f64) -> (f64, f64) {
        let scaled = distance / self.sigma;
        let normal = (1.0 - self.outlier_share) * libm::exp(-0.5 * scaled * scaled)
            / (self.sigma * libm::sqrt(TAU));
        (normal + self.outlier_share / TAU, -normal * scaled / self.sigma)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_outliers_the_information_is_the_inverse_variance() {
        for sigma in [1e-3, 0.05, 0.2468] {
            let exact = 1.0 / (sigma * sigma);
            let gaussian = BearingMixture::new(0.0, 0.3, sigma).expect("in range");
            assert!((gaussian.fisher_information() / exact - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_density_integrates_to_one_over_a_turn() {
        let mixture = BearingMixture::new(0.19, 0.1, 0.2468).expect("in range");
        let step = TAU / 4096.0;
        let total: f64 = (0..4096).map(|i| mixture.density(f64::from(i) * step) * step).sum();
        assert!((total - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_out_of_range_is_refused() {
        for (share, bias, sigma) in
            [(1.0, 0.0, 0.1), (-0.1, 0.0, 0.1), (0.1, f64::NAN, 0.1), (0.1, 0.0, 0.0)]
        {
            assert!(BearingMixture::new(share, bias, sigma).is_err());
        }
    }
}
