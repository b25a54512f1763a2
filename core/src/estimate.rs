use nalgebra::{SMatrix, SVector};

/// A state vector; its first two components are the target's East and North in metres.
pub type State<const N: usize> = SVector<f64, N>;

/// A covariance matrix.
pub type Covariance<const N: usize> = SMatrix<f64, N, N>;

/// An estimator's belief: the first two moments of its posterior.
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

    /// The part of the belief about the place of the target.
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
    /// The belief of a state of `N` components that begins with this place. Each of the further
    /// components, such as a velocity or a transmitted power, has this mean and this standard
    /// deviation, and is independent of all others.
    #[must_use]
    pub fn with_rest<const N: usize>(&self, mean: f64, sigma: f64) -> Estimate<N> {
        const { assert!(N >= 2, "a state holds East and North") };
        let mut whole = Estimate::isotropic(State::<N>::repeat(mean), sigma);
        whole.mean.fixed_rows_mut::<2>(0).copy_from(&self.mean);
        whole.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&self.covariance);
        whole
    }

    /// The ellipse that holds the target with the given probability if the belief is Gaussian.
    ///
    /// `None` when the covariance is not positive definite or `probability` is not in (0, 1).
    #[must_use]
    pub fn ellipse(&self, probability: f64) -> Option<Ellipse> {
        if !(probability > 0.0 && probability < 1.0) {
            return None;
        }
        // Closed form of a symmetric 2 × 2 eigenproblem; χ²₂ has the quantile −2 ln(1 − p).
        let a = self.covariance[(0, 0)];
        let b = self.covariance[(0, 1)];
        let c = self.covariance[(1, 1)];
        let centre = 0.5 * (a + c);
        let radius = libm::hypot(0.5 * (a - c), b);
        let scale = -2.0 * libm::log1p(-probability);
        let ellipse = Ellipse {
            semi_major: libm::sqrt(scale * (centre + radius)),
            semi_minor: libm::sqrt(scale * (centre - radius)),
            orientation: 0.5 * libm::atan2(2.0 * b, a - c),
        };
        (ellipse.semi_minor > 0.0 && ellipse.semi_major.is_finite()).then_some(ellipse)
    }
}

/// Visits the 2N cubature points x̂ ± √N Lᵢ, P = L Lᵀ, of weight 1/2N each: their mean and
/// covariance are the estimate's (Arasaratnam & Haykin 2009, eq. 31). Where P has no factor,
/// the mean alone stands for the belief.
pub fn visit_cubature_points<const N: usize>(
    estimate: &Estimate<N>,
    visit: &mut dyn FnMut(&State<N>, f64),
) {
    let Some(factor) = estimate.covariance.cholesky() else {
        visit(&estimate.mean, 1.0);
        return;
    };
    let dimension = f64::from(u16::try_from(N).unwrap_or(u16::MAX));
    let spread = factor.unpack() * libm::sqrt(dimension);
    for column in spread.column_iter() {
        visit(&(estimate.mean + column), 0.5 / dimension);
        visit(&(estimate.mean - column), 0.5 / dimension);
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
    use approx::assert_abs_diff_eq;
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    #[test]
    fn further_components_are_independent_of_the_place() {
        let covariance = Matrix2::new(4.0, 1.0, 1.0, 9.0);
        let place = Estimate { mean: Vector2::new(1.0, 2.0), covariance };
        let whole: Estimate<4> = place.with_rest(-3.0, 0.5);
        assert_eq!(whole.mean, nalgebra::Vector4::new(1.0, 2.0, -3.0, -3.0));
        assert_eq!(whole.position(), place);
        let mut expected = nalgebra::Matrix4::from_diagonal_element(0.25);
        expected.fixed_view_mut::<2, 2>(0, 0).copy_from(&covariance);
        assert_eq!(whole.covariance, expected);
    }

    #[test]
    fn the_ellipse_follows_the_covariance() {
        // σ = 3 m along 30°, 1 m across it.
        let s = 0.5;
        let c = libm::sqrt(0.75);
        let turn = Matrix2::new(c, -s, s, c);
        let covariance = turn * Matrix2::new(9.0, 0.0, 0.0, 1.0) * turn.transpose();
        let estimate = Estimate { mean: Vector2::zeros(), covariance };
        let ellipse = estimate.ellipse(0.95).expect("positive definite");
        let scale = libm::sqrt(5.991_464_547_107_979);
        assert_abs_diff_eq!(ellipse.semi_major, 3.0 * scale, epsilon = 1e-12);
        assert_abs_diff_eq!(ellipse.semi_minor, scale, epsilon = 1e-12);
        assert_abs_diff_eq!(ellipse.orientation, core::f64::consts::FRAC_PI_6, epsilon = 1e-12);
        // Its tip lies on the same level of the NEES.
        let tip = Vector2::new(c, s) * ellipse.semi_major;
        assert_abs_diff_eq!(estimate.nees(&tip).expect("definite"), scale * scale, epsilon = 1e-12);
        assert_eq!(estimate.ellipse(1.0), None);
        let flat = Estimate { mean: Vector2::zeros(), covariance: Matrix2::zeros() };
        assert_eq!(flat.ellipse(0.95), None);
    }

    #[test]
    fn cubature_points_keep_both_moments() {
        let estimate = Estimate {
            mean: Vector2::new(3.0, -1.0),
            covariance: Matrix2::new(4.0, 1.0, 1.0, 2.0),
        };
        let mut mean = Vector2::zeros();
        let mut second = Matrix2::zeros();
        let mut total = 0.0;
        visit_cubature_points(&estimate, &mut |x, w| {
            mean += x * w;
            second += (x - estimate.mean) * (x - estimate.mean).transpose() * w;
            total += w;
        });
        assert_abs_diff_eq!(total, 1.0, epsilon = 1e-15);
        assert!((mean - estimate.mean).norm() < 1e-14);
        assert!((second - estimate.covariance).norm() < 1e-14);
    }
}
