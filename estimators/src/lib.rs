//! Estimators that are chosen at run time.
//!
//! A filter is generic over the sizes of its state and its measurement, and its code is compiled
//! wherever it is used. This package uses every filter once for each of the five sizes that hunts
//! and trials have ([`FilterOf`]), so that nothing above it compiles one again: it alone is worth
//! optimising, and it alone takes long to build.

mod estimator;
mod filter;
mod track;

use foxhunt_core::Estimator;

pub use estimator::{EstimatorConfig, MovingConfig, ReceiverModel};
pub use filter::{AnyModel, AnyMotion, FilterConfig, FilterOf, GateConfig, OutlierConfig, Prior};
pub use track::{Components, TimeStep, Track, TrackConfig, TrackError, TrackStep, WithoutBearing};

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
