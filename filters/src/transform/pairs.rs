use foxhunt_core::Estimate;
use nalgebra::{SMatrix, SVector};

use crate::{
    Gaussian, Image, Map, Moments,
    count::number,
    triangle::{self, lower_root},
};

/// A rule of symmetric pairs of points x̂ ± c lᵢ about the mean, with lᵢ the columns of L; what
/// the [`Unscented`](crate::Unscented) and the [`Cubature`](crate::Cubature) transform share.
///
/// Every deviation is taken about the image of the mean and wrapped there, once: δᵢ± =
/// f(x̂ ± c lᵢ) ⊖ f(x̂). With
///
/// - dᵢ = (δᵢ⁺ − δᵢ⁻) / 2c, the slope along lᵢ,
/// - sᵢ = (δᵢ⁺ + δᵢ⁻) / 2c², the curvature along it, s = Σ sᵢ, s̄ = s / n,
///
/// the image is
///
/// - ŷ = f(x̂) + s,
/// - V = L⁻¹ Pxy has the rows dᵢᵀ,
/// - Pyy − Vᵀ V = c² Σ (sᵢ − s̄)(sᵢ − s̄)ᵀ + k s sᵀ = Σ wᵢ wᵢᵀ, wᵢ = c (sᵢ − s̄) + √(k / n) s,
///
/// with k ≥ 0 the kurtosis; in the last sum the mixed terms vanish, because they do for sᵢ − s̄.
pub(super) struct Pairs {
    /// c².
    pub(super) square: f64,
    /// k.
    pub(super) kurtosis: f64,
}

impl Pairs {
    #[inline(always)]
    pub(super) fn image<const A: usize, const B: usize>(
        &self,
        source: &Gaussian<A>,
        map: &impl Map<A, B>,
    ) -> Image<A, B> {
        let centre = map.value(source.mean());
        let spread = libm::sqrt(self.square);
        let inverse = 1.0 / spread;
        let mut whitened_cross = SMatrix::<f64, A, B>::zeros();
        // c sᵢ, and s.
        let mut bent = SMatrix::<f64, B, A>::zeros();
        for i in 0..A {
            let offset = source.factor().column(i) * spread;
            let [odd, even] = map.parts(source.mean(), &centre, &offset);
            whitened_cross.set_row(i, &(odd * inverse).transpose());
            bent.set_column(i, &(even * inverse));
        }
        let curvature: SVector<f64, B> = bent.column_sum() * inverse;
        let common = libm::sqrt(self.kurtosis / number(A)) - libm::sqrt(self.square) / number(A);
        bent.column_iter_mut().for_each(|mut each| each += curvature * common);
        let unexplained = if A > B {
            lower_root([bent])
        } else {
            let mut padded = SMatrix::<f64, B, B>::zeros();
            bent.column_iter().enumerate().for_each(|(i, each)| padded.set_column(i, &each));
            padded
        };
        Image { mean: centre + curvature, whitened_cross, unexplained }
    }

    /// The moments, by the textbook's weights 1 / 2c² of a pair: with the odd parts oᵢ = c dᵢ and
    /// the even parts eᵢ = c² sᵢ, Pxy = Σ c lᵢ oᵢᵀ / c² and Pyy = Σ (oᵢ oᵢᵀ + eᵢ eᵢᵀ) / c² +
    /// (k − c² / n) s sᵀ.
    #[inline(always)]
    pub(super) fn moments<const A: usize, const B: usize>(
        &self,
        source: &Estimate<A>,
        map: &impl Map<A, B>,
    ) -> Option<Moments<A, B>> {
        let spread = triangle::cholesky(source.covariance * self.square)?;
        // A copy, so that what a map works out from it alone is worked out once.
        let mean = source.mean;
        let centre = map.value(&mean);
        let weight = 1.0 / self.square;
        // Added to −0, a number is itself to the bit, so that the first additions fall away.
        let mut curvature = SVector::<f64, B>::repeat(-0.0);
        let mut cross = SMatrix::<f64, A, B>::repeat(-0.0);
        let mut covariance = SMatrix::<f64, B, B>::repeat(-0.0);
        for offset in spread.column_iter().map(|column| column.into_owned()) {
            let [odd, even] = map.parts(&mean, &centre, &offset);
            curvature += even;
            cross += offset * odd.transpose();
            covariance += odd * odd.transpose() + even * even.transpose();
        }
        curvature *= weight;
        let common = curvature * (self.kurtosis - self.square / number(A));
        Some(Moments {
            mean: centre + curvature,
            cross: cross * weight,
            covariance: covariance * weight + common * curvature.transpose(),
        })
    }
}
