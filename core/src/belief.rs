use nalgebra::Vector2;

use crate::{Estimate, Estimator};

/// Where a target may be: what a planner sees of an estimator, whatever its state holds.
pub trait Belief {
    /// The first two moments of the target's position.
    fn position(&self) -> Estimate<2>;

    /// Calls `visit` with places and weights that stand for the whole belief; the weights sum
    /// to 1. A particle filter shows its cloud, a Gaussian its cubature points.
    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64));
}

/// The belief that an [`Estimator`] holds.
#[derive(Debug)]
pub struct BeliefOf<'a, E: ?Sized, const N: usize, const M: usize>(pub &'a E);

impl<E: ?Sized + Estimator<N, M>, const N: usize, const M: usize> Belief for BeliefOf<'_, E, N, M> {
    fn position(&self) -> Estimate<2> {
        self.0.estimate().position()
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        self.0.visit_samples(&mut |state, weight| {
            visit(&state.fixed_rows::<2>(0).into_owned(), weight);
        });
    }
}

/// A Gaussian is its own belief.
impl Belief for Estimate<2> {
    fn position(&self) -> Estimate<2> {
        *self
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        visit_cubature_points(self, visit);
    }
}

/// Visits the 2N cubature points x̂ ± √N Lᵢ, P = L Lᵀ, of weight 1/2N each: their mean and
/// covariance are the estimate's (Arasaratnam & Haykin 2009, eq. 31). Where P has no factor,
/// the mean alone stands for the belief.
pub fn visit_cubature_points<const N: usize>(
    estimate: &Estimate<N>,
    visit: &mut dyn FnMut(&crate::State<N>, f64),
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

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2;

    use super::*;

    #[test]
    fn cubature_points_keep_both_moments() {
        let estimate = Estimate {
            mean: Vector2::new(3.0, -1.0),
            covariance: Matrix2::new(4.0, 1.0, 1.0, 2.0),
        };
        let (mut mean, mut second, mut total) = (Vector2::zeros(), Matrix2::zeros(), 0.0);
        estimate.visit_positions(&mut |x, w| {
            mean += x * w;
            second += (x - estimate.mean) * (x - estimate.mean).transpose() * w;
            total += w;
        });
        assert!((total - 1.0).abs() < 1e-15);
        assert!((mean - estimate.mean).norm() < 1e-14);
        assert!((second - estimate.covariance).norm() < 1e-14);
    }
}
