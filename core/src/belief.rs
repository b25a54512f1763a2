use nalgebra::Vector2;

use crate::{Estimate, Estimator, visit_cubature_points};

/// Belief about a target's place: a planner's view of an estimator, whatever its state holds.
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
