use nalgebra::{SMatrix, SVector};

use crate::Gaussian;

/// A map between two vector spaces, either of which may hold angles.
pub trait Map<const A: usize, const B: usize> {
    /// The image of `x`.
    fn value(&self, x: &SVector<f64, A>) -> SVector<f64, B>;

    /// Its derivative at `x`.
    fn jacobian(&self, x: &SVector<f64, A>) -> SMatrix<f64, B, A>;

    /// `y ⊖ z` in the image.
    fn minus(&self, y: &SVector<f64, B>, z: &SVector<f64, B>) -> SVector<f64, B>;

    /// The image of `x + offset` ⊖ `image`, that of `x`; a map that has a form of it with fewer
    /// roundings overrides it.
    fn change(
        &self,
        x: &SVector<f64, A>,
        image: &SVector<f64, B>,
        offset: &SVector<f64, A>,
    ) -> SVector<f64, B> {
        self.minus(&self.value(&(x + offset)), image)
    }

    /// The odd and the even part of the [change](Self::change) over an offset: half the difference
    /// of its change and its opposite's, and half their sum.
    #[inline(always)]
    fn parts(
        &self,
        x: &SVector<f64, A>,
        image: &SVector<f64, B>,
        offset: &SVector<f64, A>,
    ) -> [SVector<f64, B>; 2] {
        let ahead = self.change(x, image, offset);
        let behind = self.change(x, image, &-offset);
        [(ahead - behind) * 0.5, (ahead + behind) * 0.5]
    }
}

/// The image of a Gaussian x ~ N(x̂, L Lᵀ) under a map.
///
/// The image's covariance is not held as such but as what a linear regression on x explains and
/// what it leaves: Pyy = Vᵀ V + W Wᵀ. From these two every posterior follows by sums of squares,
/// without a difference that could lose definiteness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Image<const A: usize, const B: usize> {
    /// The mean ŷ.
    pub mean: SVector<f64, B>,
    /// V = L⁻¹ Pxy: the covariance of y with the whitened x.
    pub whitened_cross: SMatrix<f64, A, B>,
    /// W: W Wᵀ is the covariance of y that the regression leaves. Zero for a linear map.
    pub unexplained: SMatrix<f64, B, B>,
}

/// The moments of y = map(x), and how it goes with x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments<const A: usize, const B: usize> {
    /// The mean ŷ.
    pub mean: SVector<f64, B>,
    /// Pxy.
    pub cross: SMatrix<f64, A, B>,
    /// Pyy, its lower triangle.
    pub covariance: SMatrix<f64, B, B>,
}

impl<const A: usize, const B: usize> Image<A, B> {
    /// The image of `source` as plain moments: L V and Vᵀ V + W Wᵀ.
    #[must_use]
    #[inline(always)]
    pub fn moments(&self, source: &Gaussian<A>) -> Moments<A, B> {
        let Self { mean, whitened_cross, unexplained } = self;
        Moments {
            mean: *mean,
            cross: source.factor() * whitened_cross,
            covariance: whitened_cross.tr_mul(whitened_cross)
                + unexplained * unexplained.transpose(),
        }
    }
}
