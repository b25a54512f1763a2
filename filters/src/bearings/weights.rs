use foxhunt_core::parameter::positive;

use crate::batch::BatchError;

/// Weights of bearings that stray (Lenth 1981, eq. 4.5 to 4.7), by their standardised error t =
/// √(2κ (1 − cos e)): about the error in standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum BearingWeights {
    /// All alike: the maximum likelihood of von Mises errors.
    Even,
    /// Huber's: 1 up to `c`, then c/t. Usual is 1.5.
    Huber {
        /// Standardised error at which the weight begins to fall.
        c: f64,
    },
    /// Andrews's sine: sin(t/c) / (t/c) up to πc, then nothing. Usual is 1.5.
    Andrews {
        /// The scale of the sine.
        c: f64,
    },
}

impl BearingWeights {
    pub(super) fn check(self) -> Result<Self, BatchError> {
        match self {
            Self::Even => {}
            Self::Huber { c } | Self::Andrews { c } => {
                positive("c", c)?;
            }
        }
        Ok(self)
    }

    /// The weight of a standardised error t ≥ 0.
    pub(super) fn of(&self, t: f64) -> f64 {
        match *self {
            Self::Huber { c } if t > c => c / t,
            Self::Andrews { c } if t >= core::f64::consts::PI * c => 0.0,
            Self::Andrews { c } if t > 1e-8 * c => libm::sin(t / c) / (t / c),
            _ => 1.0,
        }
    }
}

/// 1/κ for a mean cosine C̄ of the errors (Lenth 1981, eq. 2.10, his approximation of the inverse
/// of I₁(κ)/I₀(κ)).
pub(super) fn inverse_concentration(mean_cosine: f64) -> f64 {
    let c = mean_cosine;
    let apart = 1.0 - c;
    2.0 * apart + apart * apart * (0.48794 - 0.82905 * c - 1.3915 * c * c) / c
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_concentration_is_that_of_the_paper() {
        // 2 (1 − C) + (1 − C)² (0.48794 − 0.82905 C − 1.3915 C²) / C, by hand.
        assert!((inverse_concentration(0.8) - 0.346_707).abs() < 1e-12);
        assert!((inverse_concentration(0.5) - 0.862_77).abs() < 1e-12);
    }

    #[test]
    fn weights_fall_where_the_paper_lets_them() {
        let huber = BearingWeights::Huber { c: 1.5 };
        assert!((huber.of(1.4) - 1.0).abs() < 1e-15 && (huber.of(3.0) - 0.5).abs() < 1e-15);
        let andrews = BearingWeights::Andrews { c: 1.5 };
        let quarter = 0.75 * core::f64::consts::PI;
        assert!((andrews.of(quarter) - core::f64::consts::FRAC_2_PI).abs() < 1e-15);
        assert!(andrews.of(2.0 * quarter + 1e-9) < 1e-9 && andrews.of(9.0) <= 0.0);
        assert!((andrews.of(0.0) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn the_concentration_is_near_the_ratio_of_bessel_functions() {
        // I₁(κ)/I₀(κ) (Mardia & Jupp 2000, appendix 1).
        for (kappa, ratio) in [(1.0, 0.446_40), (2.0, 0.697_77), (5.0, 0.893_38), (10.0, 0.948_60)]
        {
            let found = 1.0 / inverse_concentration(ratio);
            assert!((found / kappa - 1.0).abs() < 0.03, "{found} for {kappa}");
        }
    }
}
