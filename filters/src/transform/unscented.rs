use foxhunt_core::{
    Estimate, EstimatorError,
    parameter::{finite, in_range, not_negative, require},
};

use super::pairs::Pairs;
use crate::{Gaussian, Image, Map, Moments, Transform, count::number};

/// The scaled unscented transform (Wan & van der Merwe 2000): the unscented Kalman filter.
///
/// The points are the mean x̂ and x̂ ± c lᵢ, with lᵢ the columns of L and c² = α² (n + κ). With the
/// slopes dᵢ = (δᵢ⁺ − δᵢ⁻) / 2c and the curvatures sᵢ = (δᵢ⁺ + δᵢ⁻) / 2c² of the deviations δᵢ± =
/// f(x̂ ± c lᵢ) ⊖ f(x̂), their sum s and mean s̄, the textbook's weighted sums (Pritzl 2018,
/// eqs. 4.7-4.9 and 4.14-4.18) are, term by term,
///
/// - ŷ = f(x̂) + s,
/// - V = L⁻¹ Pxy has the rows dᵢᵀ,
/// - Pyy − Vᵀ V = c² Σ (sᵢ − s̄)(sᵢ − s̄)ᵀ + (β + α² κ / n) s sᵀ.
///
/// Written so there is no weight of −10⁶ at the centre to cancel against, and no covariance that
/// rounding could make indefinite: [`check`](Transform::check) requires n + κ > 0 and
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
}

impl Unscented {
    /// Its rule for states of `dimension` components.
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
