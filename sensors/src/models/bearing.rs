//! Bearings alone, and the mixture that their errors have indoors.

use core::f64::consts::{PI, TAU};

use foxhunt_core::{
    MeasurementModel, Observation, OutlierMixture, Pose, Quantity, State, angle, elementary,
    gaussian_log_likelihood, log_likelihoods_one_by_one,
    parameter::{self, ParameterError},
    vectorised::run,
};
use nalgebra::{SMatrix, Vector1};

use super::{BearingResiduals, Sight, differences};

/// The bearing alone, z = atan2(N, E) + μ (Isaacs et al. 2014, eq. 29), if need be with a share
/// of reflections that point anywhere (eq. 30).
///
/// The bias μ is part of `expected`, so every estimator takes it off. The outliers are part of
/// the likelihood only: a particle filter or a grid sees the whole mixture, a Kalman filter its
/// Gaussian part and needs a gate. σ is the observation's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BearingOnly {
    bias: f64,
    outliers: Option<OutlierMixture<1>>,
}

impl BearingOnly {
    /// The model without bias and without outliers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// 19 % outliers and a bias of 0.0929 rad (Isaacs et al. 2014, eq. 30); its σ of 0.2468 rad
    /// belongs into the observations.
    #[must_use]
    pub fn isaacs2014() -> Self {
        Self { bias: 0.0929, outliers: OutlierMixture::new(0.19, [TAU]).ok() }
    }

    /// Sets the bias of bearings, in radians counter-clockwise of the truth.
    ///
    /// # Errors
    ///
    /// If the bias is not finite.
    pub fn with_bias(self, bias: f64) -> Result<Self, ParameterError> {
        Ok(Self { bias: parameter::finite("bias", bias)?, ..self })
    }

    /// Sets a share of bearings that point anywhere.
    ///
    /// # Errors
    ///
    /// If the share is not in [0, 1).
    pub fn with_outliers(self, share: f64) -> Result<Self, ParameterError> {
        Ok(Self { outliers: Some(OutlierMixture::new(share, [TAU])?), ..self })
    }
}

impl<const N: usize> MeasurementModel<N, 1> for BearingOnly {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::BEARING]
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector1<f64> {
        Vector1::new(angle::wrap(Sight::new(state, receiver, 0.0).bearing() + self.bias))
    }

    #[inline(always)]
    fn expected_change(
        &self,
        state: &State<N>,
        expected: &Vector1<f64>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> Vector1<f64> {
        let [odd, even] = self.expected_parts(state, expected, offset, receiver);
        odd + even
    }

    /// Computes them from the changes of range and bearing, where these are plain: no large numbers
    /// are subtracted.
    #[inline(always)]
    fn expected_parts(
        &self,
        state: &State<N>,
        expected: &Vector1<f64>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> [Vector1<f64>; 2] {
        match Sight::new(state, receiver, 0.0).parts(offset[0], offset[1]) {
            Some((_, turns)) => turns.map(Vector1::new),
            None => differences(self, *state, *expected, *offset, receiver),
        }
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 1, N> {
        let sight = Sight::new(state, receiver, 0.0);
        let mut jacobian = SMatrix::<f64, 1, N>::zeros();
        [jacobian[(0, 0)], jacobian[(0, 1)]] = sight.bearing_slope();
        jacobian
    }

    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &Vector1<f64>,
        receiver: &Pose,
        [out]: [&mut [f64]; 1],
    ) {
        let places = [columns[0], columns[1]];
        let bearing = angle::wrap(z[0] - self.bias);
        run(BearingResiduals { places, receiver, bearing, out });
    }

    fn log_likelihood(&self, state: &State<N>, observation: &Observation<1>) -> f64 {
        let gaussian = gaussian_log_likelihood(self, state, observation);
        match &self.outliers {
            Some(outliers) if !observation.is_empty() => {
                outliers.log_density(gaussian, observation)
            }
            _ => gaussian,
        }
    }

    #[inline(always)]
    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<1>, out: &mut [f64]) {
        if !observation.is_plain() || observation.is_empty() {
            return log_likelihoods_one_by_one(self, columns, observation, out);
        }
        let place = observation.receiver().position;
        let bearing = angle::wrap(observation.value()[0] - self.bias);
        let slope = -0.5 / observation.noise()[(0, 0)];
        let square = |east: f64, north: f64| {
            let off = bearing - elementary::atan2(north - place.y, east - place.x);
            let off = if off > PI { off - TAU } else { off };
            let off = if off < -PI { off + TAU } else { off };
            off * off
        };
        let peak = observation.log_density(&Vector1::zeros());
        let places = out.iter_mut().zip(columns[0]).zip(columns[1]);
        match self.outliers.filter(|outliers| outliers.share() > 0.0) {
            Some(outliers) => {
                let [peak, even] = outliers.log_parts(peak, observation).map(libm::exp);
                for ((out, east), north) in places {
                    let normal = peak * elementary::exp(slope * square(*east, *north));
                    *out = elementary::ln(normal + even);
                }
            }
            None => {
                for ((out, east), north) in places {
                    *out = peak + slope * square(*east, *north);
                }
            }
        }
    }
}

/// Errors of bearings indoors: f(e) = (1 − p₀) N(e; μ, σ²) + p₀/2π over one turn (Isaacs et al.
/// 2014, eq. 30).
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

    /// p₀ = 0.19, μ = 0.0929 rad, σ = 0.2468 rad (Isaacs et al. 2014, §V-B).
    #[must_use]
    pub fn isaacs2014() -> Self {
        Self { outlier_share: 0.19, bias: 0.0929, sigma: 0.2468 }
    }

    /// The most likely density of these errors in radians, by expectation maximisation (Dempster,
    /// Laird & Rubin 1977); [`None`] for less than four errors, or where one is not finite.
    ///
    /// σ is at least a thousandth of a radian: a single error would draw it to 0.
    #[must_use]
    pub fn fit(errors: &[f64]) -> Option<Self> {
        const LEAST_ERRORS: usize = 4;
        const LEAST_SIGMA: f64 = 1e-3;
        const MOST_ROUNDS: u16 = 2000;

        if errors.len() < LEAST_ERRORS || errors.iter().any(|error| !error.is_finite()) {
            return None;
        }
        let mut fit = Self { outlier_share: 0.2, bias: 0.0, sigma: 0.3 };
        for _ in 0..MOST_ROUNDS {
            // Sums over the errors, each with the probability that it is no outlier.
            let mut count = 0.0;
            let mut inliers = 0.0;
            let mut first = 0.0;
            let mut second = 0.0;
            for error in errors {
                let distance = angle::wrap(error - fit.bias);
                let (density, _) = fit.about_bias(distance);
                let inlier = 1.0 - fit.outlier_share / TAU / density;
                count += 1.0;
                inliers += inlier;
                first += inlier * distance;
                second += inlier * distance * distance;
            }
            if inliers <= 0.0 {
                return None;
            }
            let shift = first / inliers;
            let variance = second / inliers - shift * shift;
            let sigma = libm::sqrt(variance.max(LEAST_SIGMA * LEAST_SIGMA));
            let next = Self {
                outlier_share: (1.0 - inliers / count).clamp(1e-9, 1.0 - 1e-9),
                bias: angle::wrap(fit.bias + shift),
                sigma,
            };
            let moved = (next.outlier_share - fit.outlier_share).abs()
                + shift.abs()
                + (next.sigma - fit.sigma).abs();
            fit = next;
            if moved < 1e-10 {
                break;
            }
        }
        Some(fit)
    }

    /// The share p₀ of outliers.
    #[must_use]
    pub fn outlier_share(&self) -> f64 {
        self.outlier_share
    }

    /// The bias μ in radians.
    #[must_use]
    pub fn bias(&self) -> f64 {
        self.bias
    }

    /// The deviation σ in radians.
    #[must_use]
    pub fn sigma(&self) -> f64 {
        self.sigma
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
    use approx::assert_abs_diff_eq;

    #[test]
    fn without_outliers_the_information_is_the_inverse_variance() {
        for sigma in [1e-3, 0.05, 0.2468] {
            let exact = 1.0 / (sigma * sigma);
            let gaussian = BearingMixture::new(0.0, 0.3, sigma).expect("in range");
            assert_abs_diff_eq!(gaussian.fisher_information() / exact, 1.0, epsilon = 1e-12);
        }
    }

    #[test]
    fn the_density_integrates_to_one_over_a_turn() {
        let mixture = BearingMixture::new(0.19, 0.1, 0.2468).expect("in range");
        let step = TAU / 4096.0;
        let total: f64 = (0..4096).map(|i| mixture.density(f64::from(i) * step) * step).sum();
        assert_abs_diff_eq!(total, 1.0, epsilon = 1e-12);
    }

    #[test]
    fn a_fit_finds_the_mixture_that_errors_are_drawn_from() {
        use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
        use rand_distr::{Distribution, Normal};

        let truth = BearingMixture::isaacs2014();
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(17);
        let normal = Normal::new(truth.bias, truth.sigma).expect("in range");
        let errors: [f64; 4000] = core::array::from_fn(|_| {
            if rng.random::<f64>() < truth.outlier_share {
                rng.random_range(-PI..PI)
            } else {
                normal.sample(&mut rng)
            }
        });
        let fit = BearingMixture::fit(&errors).expect("enough errors");
        // Four standard deviations of what 4000 errors leave unknown: of the bias 0.0048 rad (the
        // Fisher information is 11.45 rad⁻²), of σ 0.0044 rad, of the share 0.008.
        assert_abs_diff_eq!(fit.bias, truth.bias, epsilon = 0.019);
        assert_abs_diff_eq!(fit.sigma, truth.sigma, epsilon = 0.018);
        assert_abs_diff_eq!(fit.outlier_share, truth.outlier_share, epsilon = 0.032);
        // It is more likely than the density that they were drawn from.
        let likelihood = |of: &BearingMixture| -> f64 {
            errors.iter().map(|error| libm::log(of.density(*error))).sum()
        };
        assert!(likelihood(&fit) >= likelihood(&truth));
        assert_eq!(BearingMixture::fit(&errors[..3]), None);
        assert_eq!(BearingMixture::fit(&[0.0, 1.0, f64::NAN, 0.1, 0.2]), None);
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
