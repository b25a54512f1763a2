use foxhunt_core::Estimator;

/// An estimator that was chosen at run time, and can be copied with all that it believes.
pub type BoxedEstimator<const N: usize, const M: usize> = Box<dyn CloneEstimator<N, M>>;

/// An [`Estimator`] that can be copied behind a pointer; every one that is [`Clone`] is.
pub trait CloneEstimator<const N: usize, const M: usize>: Estimator<N, M> {
    /// A copy.
    fn boxed(&self) -> BoxedEstimator<N, M>;
}

impl<E, const N: usize, const M: usize> CloneEstimator<N, M> for E
where
    E: Estimator<N, M> + Clone + 'static,
{
    fn boxed(&self) -> BoxedEstimator<N, M> {
        Box::new(self.clone())
    }
}

impl<const N: usize, const M: usize> Clone for BoxedEstimator<N, M> {
    fn clone(&self) -> Self {
        (**self).boxed()
    }
}
