use foxhunt_core::Estimate;
use nalgebra::SMatrix;

use crate::{Gaussian, Image, Map, Moments, Transform};

/// First-order Taylor expansion about the mean: the extended Kalman filter
/// (Bar-Shalom, Li & Kirubarajan 2001, §10.3).
///
/// ŷ = f(x̂), Pxy = P Fᵀ, Pyy = F P Fᵀ; so V = Lᵀ Fᵀ, and nothing is left unexplained.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Taylor;

impl Transform for Taylor {
    #[inline(always)]
    fn image<const A: usize, const B: usize>(
        &self,
        source: &Gaussian<A>,
        map: &impl Map<A, B>,
    ) -> Image<A, B> {
        let jacobian = map.jacobian(source.mean());
        let whitened_cross = source.factor().tr_mul(&jacobian.transpose());
        Image { mean: map.value(source.mean()), whitened_cross, unexplained: SMatrix::zeros() }
    }
    #[inline(always)]
    fn moments<const A: usize, const B: usize>(
        &self,
        source: &Estimate<A>,
        map: &impl Map<A, B>,
    ) -> Option<Moments<A, B>> {
        let jacobian = map.jacobian(&source.mean);
        let cross = source.covariance * jacobian.transpose();
        Some(Moments { mean: map.value(&source.mean), cross, covariance: jacobian * cross })
    }
}
