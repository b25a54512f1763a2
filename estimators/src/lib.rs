//! Estimators that are chosen at run time.
//!
//! A filter is generic over the sizes of its state and its measurement, and its code is compiled
//! wherever it is used. This package uses every filter once for each of the five sizes that hunts
//! and trials have ([`FilterOf`]), and a grid for receivers of different makes
//! ([`ReceiversConfig`]), so that nothing above it compiles one again. Models and motions of which
//! only a pointer is needed get it here, too ([`IntoDyn`]). Of all packages it takes longest to
//! build.

mod dipole_grid;
mod estimator;
mod filter;
mod into_dyn;
mod pulses;
mod recalled_grid;
mod several;
mod team;
mod track;

use std::any::Any;

use foxhunt_core::{Estimator, EstimatorError, Smooth};

pub use dipole_grid::dipole_grid;
pub use estimator::{EstimatorConfig, MovingConfig, ReceiverModel};
pub use filter::{
    AnyModel, AnyMotion, FilterConfig, FilterOf, GateConfig, OutlierConfig, ParticleConfig, Prior,
};
pub use into_dyn::IntoDyn;
pub use pulses::{PulseLevelConfig, PulseModel};
pub use recalled_grid::RecalledGrid;
pub use several::SeveralConfig;
pub use team::{LearnedReceiver, MOST_RECEIVERS, ReceiversConfig};
pub use track::{
    Components, FoundTransmitter, TimeStep, Track, TrackConfig, TrackError, TrackStep,
    WithoutBearing,
};

/// An estimator that was chosen at run time, and can be copied with all that it believes.
pub type BoxedEstimator<const N: usize, const M: usize> = Box<dyn CloneEstimator<N, M>>;

/// An [`Estimator`] that can be copied and smoothed behind a pointer; every one that is [`Clone`]
/// and [`Smooth`] is.
pub trait CloneEstimator<const N: usize, const M: usize>: Estimator<N, M> {
    /// A copy.
    fn boxed(&self) -> BoxedEstimator<N, M>;

    /// The estimator as a value of its own type.
    fn as_any(&self) -> &dyn Any;

    /// [`Smooth::smooth`] by an estimator of the same type.
    ///
    /// # Errors
    ///
    /// The errors of [`Smooth::smooth`]; [`EstimatorError::Unsupported`] for one of another type.
    fn smooth_by(
        &mut self,
        later: &dyn CloneEstimator<N, M>,
        dt: f64,
    ) -> Result<(), EstimatorError>;
}

impl<E, const N: usize, const M: usize> CloneEstimator<N, M> for E
where
    E: Smooth<N, M> + Clone + 'static,
{
    fn boxed(&self) -> BoxedEstimator<N, M> {
        Box::new(self.clone())
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn smooth_by(
        &mut self,
        later: &dyn CloneEstimator<N, M>,
        dt: f64,
    ) -> Result<(), EstimatorError> {
        match later.as_any().downcast_ref::<E>() {
            Some(later) => self.smooth(later, dt),
            None => Err(EstimatorError::Unsupported {
                what: "smoothing by an estimator of another kind",
            }),
        }
    }
}

impl<const N: usize, const M: usize> Smooth<N, M> for BoxedEstimator<N, M> {
    fn smooth(&mut self, later: &Self, dt: f64) -> Result<(), EstimatorError> {
        (**self).smooth_by(&**later, dt)
    }
}

impl<const N: usize, const M: usize> Clone for BoxedEstimator<N, M> {
    fn clone(&self) -> Self {
        (**self).boxed()
    }
}
