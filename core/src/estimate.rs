use nalgebra::{SMatrix, SVector};

/// A state vector; its first two components are the target's East and North in metres.
pub type State<const N: usize> = SVector<f64, N>;

/// A covariance matrix.
pub type Covariance<const N: usize> = SMatrix<f64, N, N>;

/// What an estimator believes: the first two moments of its posterior.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate<const N: usize> {
    /// The mean.
    pub mean: State<N>,
    /// The covariance about the mean.
    pub covariance: Covariance<N>,
}

impl<const N: usize> Estimate<N> {
    /// A belief with the same standard deviation on every component.
    #[must_use]
    pub fn isotropic(mean: State<N>, sigma: f64) -> Self {
        Self { mean, covariance: Covariance::from_diagonal_element(sigma * sigma) }
    }

    /// The part of the belief that says where the target is.
    #[must_use]
    pub fn position(&self) -> Estimate<2> {
        const { assert!(N >= 2, "a state holds East and North") };
        Estimate {
            mean: self.mean.fixed_rows::<2>(0).into_owned(),
            covariance: self.covariance.fixed_view::<2, 2>(0, 0).into_owned(),
        }
    }

    /// The normalised estimation error squared, (x − x̂)ᵀ P⁻¹ (x − x̂).
    ///
    /// A consistent estimator's NEES is χ² with `N` degrees of freedom
    /// (Bar-Shalom, Li & Kirubarajan 2001, §5.4.2). `None` when the covariance is not
    /// positive definite.
    #[must_use]
    pub fn nees(&self, truth: &State<N>) -> Option<f64> {
        let error = truth - self.mean;
        Some(error.dot(&self.covariance.cholesky()?.solve(&error)))
    }
}

impl Estimate<2> {
    /// The ellipse that holds the target with the given probability if the belief is Gaussian.
    ///
    /// `None` when the covariance is not positive definite or `probability` is not in (0, 1).
    #[must_use]
    pub fn ellipse(&self, probability: f64) -> Option<Ellipse> {
        if !(probability > 0.0 && probability < 1.0) {
            return None;
        }
        // Closed form of a symmetric 2 × 2 eigenproblem; χ²₂ has the quantile −2 ln(1 − p).
        let (a, b, c) = (self.covariance[(0, 0)], self.covariance[(0, 1)], self.covariance[(1, 1)]);
        let (centre, radius) = (0.5 * (a + c), libm::hypot(0.5 * (a - c), b));
        let scale = -2.0 * libm::log1p(-probability);
        let ellipse = Ellipse {
            semi_major: libm::sqrt(scale * (centre + radius)),
            semi_minor: libm::sqrt(scale * (centre - radius)),
            orientation: 0.5 * libm::atan2(2.0 * b, a - c),
        };
        (ellipse.semi_minor > 0.0 && ellipse.semi_major.is_finite()).then_some(ellipse)
    }
}

/// A confidence ellipse about an estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Ellipse {
    /// Half the longest diameter, in metres.
    pub semi_major: f64,
    /// Half the shortest diameter, in metres.
    pub semi_minor: f64,
    /// The direction of the longest diameter, in radians counter-clockwise from East.
    pub orientation: f64,
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    #[test]
    fn the_ellipse_follows_the_covariance() {
        // σ = 3 m along 30°, 1 m across it.
        let (s, c) = (0.5, libm::sqrt(0.75));
        let turn = Matrix2::new(c, -s, s, c);
        let covariance = turn * Matrix2::new(9.0, 0.0, 0.0, 1.0) * turn.transpose();
        let estimate = Estimate { mean: Vector2::zeros(), covariance };
        let ellipse = estimate.ellipse(0.95).expect("positive definite");
        let scale = libm::sqrt(5.991_464_547_107_979);
        assert!((ellipse.semi_major - 3.0 * scale).abs() < 1e-12);
        assert!((ellipse.semi_minor - scale).abs() < 1e-12);
        assert!((ellipse.orientation - core::f64::consts::FRAC_PI_6).abs() < 1e-12);
        // Its tip lies on the same level of the NEES.
        let tip = Vector2::new(c, s) * ellipse.semi_major;
        assert!((estimate.nees(&tip).expect("definite") - scale * scale).abs() < 1e-12);
        assert_eq!(estimate.ellipse(1.0), None);
        let flat = Estimate { mean: Vector2::zeros(), covariance: Matrix2::zeros() };
        assert_eq!(flat.ellipse(0.95), None);
    }
}
