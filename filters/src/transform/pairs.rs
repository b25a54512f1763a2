use nalgebra::{SMatrix, SVector};

use crate::{Gaussian, Image, Map, count::number, triangle::lower_root};

/// The image by symmetric pairs of points x̂ ± c lᵢ about the mean, with lᵢ the columns of L; what
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
/// with c the `spread` and k ≥ 0 the `kurtosis`; in the last sum the mixed terms vanish, because
/// those of the sᵢ − s̄ do.
#[inline(always)]
pub(super) fn image<const A: usize, const B: usize>(
    source: &Gaussian<A>,
    map: &impl Map<A, B>,
    spread: f64,
    kurtosis: f64,
) -> Image<A, B> {
    let centre = map.value(source.mean());
    let half = 0.5 / spread;
    let mut whitened_cross = SMatrix::<f64, A, B>::zeros();
    // c sᵢ, then wᵢ.
    let mut bent = SMatrix::<f64, B, A>::zeros();
    for i in 0..A {
        let offset = source.factor().column(i) * spread;
        let ahead = map.change(source.mean(), &centre, &offset);
        let behind = map.change(source.mean(), &centre, &-offset);
        whitened_cross.set_row(i, &((ahead - behind) * half).transpose());
        bent.set_column(i, &((ahead + behind) * half));
    }

    let curvature: SVector<f64, B> = bent.column_sum() / spread;
    let common = curvature * (libm::sqrt(kurtosis / number(A)) - spread / number(A));
    bent.column_iter_mut().for_each(|mut each| each += common);
    let unexplained = if A > B {
        lower_root([bent])
    } else {
        let mut padded = SMatrix::<f64, B, B>::zeros();
        bent.column_iter().enumerate().for_each(|(i, each)| padded.set_column(i, &each));
        padded
    };
    Image { mean: centre + curvature, whitened_cross, unexplained }
}
