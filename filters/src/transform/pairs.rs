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
/// with k ≥ 0 the kurtosis; in the last sum the mixed terms vanish, because those of the sᵢ − s̄
/// do.
pub(super) struct Pairs {
    /// c².
    pub(super) square: f64,
    /// k.
    pub(super) kurtosis: f64,
}

/// What the pairs show of a map.
struct Slopes<const A: usize, const B: usize> {
    /// ŷ.
    mean: SVector<f64, B>,
    /// V.
    whitened_cross: SMatrix<f64, A, B>,
    /// c sᵢ.
    bent: SMatrix<f64, B, A>,
    /// s.
    curvature: SVector<f64, B>,
}

impl Pairs {
    #[inline(always)]
    fn slopes<const A: usize, const B: usize>(
        &self,
        mean: &SVector<f64, A>,
        factor: &SMatrix<f64, A, A>,
        map: &impl Map<A, B>,
    ) -> Slopes<A, B> {
        let centre = map.value(mean);
        let spread = libm::sqrt(self.square);
        let inverse = 1.0 / spread;
        let mut whitened_cross = SMatrix::<f64, A, B>::zeros();
        let mut bent = SMatrix::<f64, B, A>::zeros();
        for i in 0..A {
            let [odd, even] = map.parts(mean, &centre, &(factor.column(i) * spread));
            whitened_cross.set_row(i, &(odd * inverse).transpose());
            bent.set_column(i, &(even * inverse));
        }
        let curvature: SVector<f64, B> = bent.column_sum() * inverse;
        Slopes { mean: centre + curvature, whitened_cross, bent, curvature }
    }

    #[inline(always)]
    pub(super) fn image<const A: usize, const B: usize>(
        &self,
        source: &Gaussian<A>,
        map: &impl Map<A, B>,
    ) -> Image<A, B> {
        let Slopes { mean, whitened_cross, mut bent, curvature } =
            self.slopes(source.mean(), source.factor(), map);
        let common = libm::sqrt(self.kurtosis / number(A)) - libm::sqrt(self.square) / number(A);
        bent.column_iter_mut().for_each(|mut each| each += curvature * common);
        let unexplained = if A > B {
            lower_root([bent])
        } else {
            let mut padded = SMatrix::<f64, B, B>::zeros();
            bent.column_iter().enumerate().for_each(|(i, each)| padded.set_column(i, &each));
            padded
        };
        Image { mean, whitened_cross, unexplained }
    }

    /// The moments, with c² Σ (sᵢ − s̄)(sᵢ − s̄)ᵀ = Σ c sᵢ c sᵢᵀ − c² s sᵀ / n.
    #[inline(always)]
    pub(super) fn moments<const A: usize, const B: usize>(
        &self,
        source: &Estimate<A>,
        map: &impl Map<A, B>,
    ) -> Option<Moments<A, B>> {
        let factor = triangle::cholesky(source.covariance)?;
        let Slopes { mean, whitened_cross, bent, curvature } =
            self.slopes(&source.mean, &factor, map);
        let common = curvature * (self.kurtosis - self.square / number(A));
        let covariance = SMatrix::from_fn(|i, j| {
            let each = (0..A).map(|k| {
                whitened_cross[(k, i)] * whitened_cross[(k, j)] + bent[(i, k)] * bent[(j, k)]
            });
            each.sum::<f64>() + common[i] * curvature[j]
        });
        Some(Moments { mean, cross: factor * whitened_cross, covariance })
    }
}
