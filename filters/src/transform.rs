//! Gaussians through maps: the one thing in which the Kalman filters differ.

use foxhunt_core::{
    Estimate, EstimatorError,
    parameter::{finite, in_range, not_negative, require},
};
use nalgebra::{SMatrix, SVector};

use crate::{
    Gaussian,
    count::number,
    triangle::{self, lower_root},
};

/// Propagation of a Gaussian through a map. It is the only difference between the Kalman filters.
pub trait Transform {
    /// Returns the moments of `map(x)`, and its covariance with x.
    fn image<const A: usize, const B: usize>(
        &self,
        source: &Gaussian<A>,
        map: &impl Map<A, B>,
    ) -> Image<A, B>;

    /// Returns the moments without factors, where `source` is far from singular; `None` where it is
    /// singular.
    #[inline(always)]
    fn moments<const A: usize, const B: usize>(
        &self,
        source: &Estimate<A>,
        map: &impl Map<A, B>,
    ) -> Option<Moments<A, B>> {
        let source = Gaussian::factored(*source)?;
        Some(self.image(&source, map).moments(&source))
    }

    /// Checks that the transform's parameters suit states of `dimension` components; called once,
    /// when a filter is made.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] names the parameter that does not.
    fn check(&self, dimension: usize) -> Result<(), EstimatorError> {
        let _ = dimension;
        Ok(())
    }
}

/// A [`Transform`] by one rule for states of every size.
///
/// It therefore serves states whose size is known at run time only, such as those of
/// `DynamicKalman` (feature `alloc`).
pub trait DynamicTransform: Transform {
    /// The rule for states of `dimension` components.
    fn rule(&self, dimension: usize) -> TransformRule;
}

/// Rule by which a Gaussian goes through a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TransformRule {
    /// The slope of the map at the mean.
    Slope,
    /// Pairs of points x̂ ± c lᵢ about the mean, with lᵢ the columns of a factor of the
    /// covariance.
    Pairs {
        /// c², positive.
        square: f64,
        /// Weight k ≥ 0 of s sᵀ in the image's covariance, s the sum of all curvatures.
        kurtosis: f64,
    },
}

/// A map between two vector spaces, either of which may hold angles.
pub trait Map<const A: usize, const B: usize> {
    /// The image of `x`.
    fn value(&self, x: &SVector<f64, A>) -> SVector<f64, B>;

    /// Returns the derivative of the map at `x`.
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
/// what it leaves: Pyy = Vᵀ V + W Wᵀ. From these two every posterior follows by sums of
/// squares, without a difference that could lose definiteness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Image<const A: usize, const B: usize> {
    /// The mean ŷ.
    pub mean: SVector<f64, B>,
    /// V = L⁻¹ Pxy: the covariance of y with the whitened x.
    pub whitened_cross: SMatrix<f64, A, B>,
    /// W: W Wᵀ is the covariance of y that the regression leaves. Zero for a linear map.
    pub unexplained: SMatrix<f64, B, B>,
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

impl DynamicTransform for Taylor {
    fn rule(&self, _dimension: usize) -> TransformRule {
        TransformRule::Slope
    }
}

/// The scaled unscented transform (Wan & van der Merwe 2000): the unscented Kalman filter.
///
/// The points are the mean x̂ and x̂ ± c lᵢ, with lᵢ the columns of L and c² = α² (n +
/// κ). With the slopes dᵢ = (δᵢ⁺ − δᵢ⁻) / 2c and the curvatures sᵢ = (δᵢ⁺ +
/// δᵢ⁻) / 2c² of the deviations δᵢ± = f(x̂ ± c lᵢ) ⊖ f(x̂), their sum s and mean
/// s̄, the textbook's weighted sums (Pritzl 2018, eqs. 4.7-4.9 and 4.14-4.18) are, term by term,
///
/// - ŷ = f(x̂) + s,
/// - V = L⁻¹ Pxy has the rows dᵢᵀ,
/// - Pyy − Vᵀ V = c² Σ (sᵢ − s̄)(sᵢ − s̄)ᵀ + (β + α² κ / n) s sᵀ.
///
/// Written so there is no weight of −10⁶ at the centre to cancel against, and no covariance
/// that rounding could make indefinite: [`check`](Transform::check) requires n + κ > 0 and
/// β + α² κ / n ≥ 0.
///
/// The 2n + 1 points are a centre and n pairs, so their number needs no arithmetic on a const
/// generic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unscented {
    alpha: f64,
    beta: f64,
    kappa: Kappa,
}

impl Unscented {
    /// A transform with the spread α, the knowledge of the distribution β (2 is best for a
    /// Gaussian) and the secondary scaling κ, a number or a rule.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when α is not in [10⁻⁴, 1] (below, the curvature is
    /// rounding: its error is ε |y| / α²), β is negative or κ is not finite.
    pub fn new(alpha: f64, beta: f64, kappa: impl Into<Kappa>) -> Result<Self, EstimatorError> {
        let kappa = kappa.into();
        in_range("alpha", alpha, 1e-4..=1.0, "in [1e-4, 1]")?;
        not_negative("beta", beta)?;
        if let Kappa::Fixed(value) = kappa {
            finite("kappa", value)?;
        }
        Ok(Self { alpha, beta, kappa })
    }

    /// α = 0.001, β = 2, κ = 3 − n (Pritzl 2018, §4.4).
    #[must_use]
    pub const fn pritzl2018() -> Self {
        Self { alpha: 1e-3, beta: 2.0, kappa: Kappa::ThreeMinusN }
    }

    /// Returns the rule of the pairs for states of `dimension` components.
    #[inline(always)]
    fn pairs(&self, dimension: usize) -> Pairs {
        let n = number(dimension);
        let kappa = self.kappa.value(dimension);
        let square = self.alpha * self.alpha;
        Pairs { square: square * (n + kappa), kurtosis: self.beta + square * kappa / n }
    }
}

impl Default for Unscented {
    /// α = 1, β = 2, κ = 0: points √n standard deviations out.
    fn default() -> Self {
        Self { alpha: 1.0, beta: 2.0, kappa: Kappa::Fixed(0.0) }
    }
}

impl Transform for Unscented {
    #[inline(always)]
    fn image<const A: usize, const B: usize>(
        &self,
        source: &Gaussian<A>,
        map: &impl Map<A, B>,
    ) -> Image<A, B> {
        self.pairs(A).image(source, map)
    }

    #[inline(always)]
    fn moments<const A: usize, const B: usize>(
        &self,
        source: &Estimate<A>,
        map: &impl Map<A, B>,
    ) -> Option<Moments<A, B>> {
        self.pairs(A).moments(source, map)
    }

    fn check(&self, dimension: usize) -> Result<(), EstimatorError> {
        let n = number(dimension);
        let kappa = self.kappa.value(dimension);
        require(n + kappa > 0.0, "kappa", kappa, "above −n for states of n components")?;
        require(
            self.beta + self.alpha * self.alpha * kappa / n >= 0.0,
            "beta",
            self.beta,
            "at least −α² κ / n for states of n components",
        )?;
        Ok(())
    }
}

impl DynamicTransform for Unscented {
    fn rule(&self, dimension: usize) -> TransformRule {
        let Pairs { square, kurtosis } = self.pairs(dimension);
        TransformRule::Pairs { square, kurtosis }
    }
}

/// The secondary scaling κ of the [`Unscented`] transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kappa {
    /// One κ for every dimension.
    Fixed(f64),
    /// κ = 3 − n: keeps the kurtosis of a Gaussian (Julier & Uhlmann 1997).
    ThreeMinusN,
}

impl Kappa {
    /// κ for states of `dimension` components.
    #[must_use]
    pub fn value(self, dimension: usize) -> f64 {
        match self {
            Self::Fixed(kappa) => kappa,
            Self::ThreeMinusN => 3.0 - number(dimension),
        }
    }
}

impl From<f64> for Kappa {
    fn from(kappa: f64) -> Self {
        Self::Fixed(kappa)
    }
}

/// The third-degree spherical-radial cubature rule (Arasaratnam & Haykin 2009, eqs. 28-30): the
/// cubature Kalman filter.
///
/// 2n points x̂ ± √n lᵢ of the weight 1 / 2n, with lᵢ the columns of L; exact for
/// polynomials of degree 3. There is nothing to choose and no weight is negative. The image of the
/// mean has no weight: angles are taken about it, and it serves only that.
///
/// The moments are the same as of [`Unscented`] with α = 1, β = 0, κ = 0.
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

impl DynamicTransform for Cubature {
    fn rule(&self, dimension: usize) -> TransformRule {
        TransformRule::Pairs { square: number(dimension), kurtosis: 0.0 }
    }
}

/// A rule of symmetric pairs of points x̂ ± c lᵢ about the mean, with lᵢ the columns of L;
/// what the [`Unscented`] and the [`Cubature`] transform share.
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
/// - Pyy − Vᵀ V = c² Σ (sᵢ − s̄)(sᵢ − s̄)ᵀ + k s sᵀ = Σ wᵢ wᵢᵀ, wᵢ = c
///   (sᵢ − s̄) + √(k / n) s,
///
/// with k ≥ 0 the kurtosis; in the last sum the mixed terms vanish, because they do for sᵢ −
/// s̄.
struct Pairs {
    /// c².
    square: f64,
    /// k.
    kurtosis: f64,
}

impl Pairs {
    #[inline(always)]
    fn image<const A: usize, const B: usize>(
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

    /// The moments, by the textbook's weights 1 / 2c² of a pair: with the odd parts oᵢ = c dᵢ
    /// and the even parts eᵢ = c² sᵢ, Pxy = Σ c lᵢ oᵢᵀ / c² and Pyy = Σ (oᵢ oᵢᵀ
    /// + eᵢ eᵢᵀ) / c² + (k − c² / n) s sᵀ.
    #[inline(always)]
    fn moments<const A: usize, const B: usize>(
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
