use alloc::boxed::Box;

use foxhunt_core::{Estimate, EstimatorError, MeasurementModel, MotionModel, Role};

use crate::{Gaussian, Kalman, Transform};

/// An estimator that can go on from another Gaussian belief: what mixing, merging and
/// splitting need.
pub trait Reinitialise<const N: usize> {
    /// Puts a Gaussian in place of the belief; models, gates and their records stay.
    ///
    /// # Errors
    ///
    /// When it is not finite or its covariance not symmetric and positive definite; the belief is
    /// then left as it was.
    fn reinitialise(&mut self, estimate: &Estimate<N>) -> Result<(), EstimatorError>;
}

impl<T, F, H, const N: usize, const M: usize> Reinitialise<N> for Kalman<T, F, H, N, M>
where
    T: Transform,
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
{
    fn reinitialise(&mut self, estimate: &Estimate<N>) -> Result<(), EstimatorError> {
        self.replace(Gaussian::new(*estimate, Role::Prior)?);
        Ok(())
    }
}

impl<E: ?Sized + Reinitialise<N>, const N: usize> Reinitialise<N> for &mut E {
    fn reinitialise(&mut self, estimate: &Estimate<N>) -> Result<(), EstimatorError> {
        (**self).reinitialise(estimate)
    }
}

impl<E: ?Sized + Reinitialise<N>, const N: usize> Reinitialise<N> for Box<E> {
    fn reinitialise(&mut self, estimate: &Estimate<N>) -> Result<(), EstimatorError> {
        (**self).reinitialise(estimate)
    }
}
