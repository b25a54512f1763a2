use foxhunt_core::EstimatorError;
use nalgebra::{SMatrix, SVector};

use crate::{Gaussian, Image, Map, Transform, count::number, triangle::add_to_lower};

/// The scaled unscented transform (Wan & van der Merwe 2000): the unscented Kalman filter.
///
/// The points are the mean x̂ and x̂ ± c lᵢ, with lᵢ the columns of L and c² = α² (n + κ). Every
/// deviation is taken about the image of the mean and wrapped there, once: δᵢ± = f(x̂ ± c lᵢ) ⊖
/// f(x̂). With
///
/// - dᵢ = (δᵢ⁺ − δᵢ⁻) / 2c, the slope along lᵢ,
/// - sᵢ = (δᵢ⁺ + δᵢ⁻) / 2c², the curvature along it, s = Σ sᵢ, s̄ = s / n,
///
/// the textbook's weighted sums (Pritzl 2018, eqs. 4.7-4.9 and 4.14-4.18) are, term by term,
///
/// - ŷ = f(x̂) + s,
/// - V = L⁻¹ Pxy has the rows dᵢᵀ,
/// - Pyy − Vᵀ V = c² Σ (sᵢ − s̄)(sᵢ − s̄)ᵀ + (β + α² κ / n) s sᵀ.
///
/// Written so there is no weight of −10⁶ at the centre to cancel against, and no covariance that
/// rounding could make indefinite: [`check`](Transform::check) asks for n + κ > 0 and
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
    /// The same for every dimension.
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
        let refuse =
            |name, value, requirement| Err(EstimatorError::Parameter { name, value, requirement });
        if !(1e-4..=1.0).contains(&alpha) {
            return refuse("alpha", alpha, "in [1e-4, 1]");
        }
        if !(beta >= 0.0 && beta.is_finite()) {
            return refuse("beta", beta, "a non-negative number");
        }
        match kappa.into() {
            Kappa::Fixed(value) if !value.is_finite() => refuse("kappa", value, "finite"),
            kappa => Ok(Self { alpha, beta, kappa }),
        }
    }

    /// α = 0.001, β = 2, κ = 3 − n (Pritzl 2018, §4.4).
    #[must_use]
    pub const fn pritzl2018() -> Self {
        Self { alpha: 1e-3, beta: 2.0, kappa: Kappa::ThreeMinusN }
    }
}

impl Default for Unscented {
    /// α = 1, β = 2, κ = 0: points √n standard deviations out.
    fn default() -> Self {
        Self { alpha: 1.0, beta: 2.0, kappa: Kappa::Fixed(0.0) }
    }
}

impl Transform for Unscented {
    fn image<const A: usize, const B: usize>(
        &self,
        source: &Gaussian<A>,
        map: &impl Map<A, B>,
    ) -> Image<A, B> {
        let (n, kappa) = (number(A), self.kappa.value(A));
        let spread = self.alpha * libm::sqrt(n + kappa);
        let centre = map.value(source.mean());

        let mut whitened_cross = SMatrix::<f64, A, B>::zeros();
        let mut curvatures = SMatrix::<f64, B, A>::zeros();
        for i in 0..A {
            let offset = source.factor().column(i) * spread;
            let ahead = map.minus(&map.value(&(source.mean() + offset)), &centre);
            let behind = map.minus(&map.value(&(source.mean() - offset)), &centre);
            whitened_cross.set_row(i, &((ahead - behind) / (2.0 * spread)).transpose());
            curvatures.set_column(i, &((ahead + behind) / (2.0 * spread * spread)));
        }

        let curvature: SVector<f64, B> = curvatures.column_sum();
        let kurtosis = self.beta + self.alpha * self.alpha * kappa / n;
        let mut unexplained = SMatrix::zeros();
        add_to_lower(&mut unexplained, curvature * libm::sqrt(kurtosis));
        for each in curvatures.column_iter() {
            add_to_lower(&mut unexplained, (each - curvature / n) * spread);
        }
        Image { mean: centre + curvature, whitened_cross, unexplained }
    }

    fn check(&self, dimension: usize) -> Result<(), EstimatorError> {
        let (n, kappa) = (number(dimension), self.kappa.value(dimension));
        if n + kappa <= 0.0 {
            let requirement = "above −n for states of n components";
            return Err(EstimatorError::Parameter { name: "kappa", value: kappa, requirement });
        }
        if self.beta + self.alpha * self.alpha * kappa / n < 0.0 {
            let requirement = "at least −α² κ / n for states of n components";
            return Err(EstimatorError::Parameter { name: "beta", value: self.beta, requirement });
        }
        Ok(())
    }
}
