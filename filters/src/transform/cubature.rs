use foxhunt_core::Estimate;

use super::pairs::Pairs;
use crate::{Gaussian, Image, Map, Moments, Transform, count::number};

/// The third-degree spherical-radial cubature rule (Arasaratnam & Haykin 2009, eqs. 28-30): the
/// cubature Kalman filter.
///
/// 2n points x̂ ± √n lᵢ of the weight 1 / 2n, with lᵢ the columns of L; exact for polynomials of
/// degree 3. There is nothing to choose and no weight is negative. The image of the mean has no
/// weight: angles are taken about it, and it serves only that.
///
/// The moments are the same as of [`Unscented`](crate::Unscented) with α = 1, β = 0, κ = 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cubature;

impl Transform for Cubature {
    #[inline(always)]
    fn image<const A: usize, const B: usize>(
        &self,
        source: &Gaussian<A>,
        map: &impl Map<A, B>,
    ) -> Image<A, B> {
        Pairs { square: number(A), kurtosis: 0.0 }.image(source, map)
    }

    #[inline(always)]
    fn moments<const A: usize, const B: usize>(
        &self,
        source: &Estimate<A>,
        map: &impl Map<A, B>,
    ) -> Option<Moments<A, B>> {
        Pairs { square: number(A), kurtosis: 0.0 }.moments(source, map)
    }
}
