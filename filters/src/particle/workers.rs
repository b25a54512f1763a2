use foxhunt_core::{MeasurementModel, MotionModel};

#[cfg(feature = "parallel")]
use super::divided::on_threads;
use super::{
    cloud::{Evidence, Modelled, Multiply},
    divided::{Threads, one_by_one},
    moments::Moments,
    step::Step,
};

/// Functions and threads that work on a cloud. Functions, as models may be used on other threads
/// only where they are `Sync`, which is no bound of the filter.
#[derive(Clone, Debug)]
pub(super) struct Workers<F, H, const N: usize, const M: usize> {
    pub(super) step: fn(Step<'_, F, N>) -> Option<Moments<N>>,
    pub(super) multiply: fn(Multiply<'_, Modelled<'_, H, N, M>>) -> Evidence,
    pub(super) threads: Threads,
}

impl<F: MotionModel<N>, H: MeasurementModel<N, M>, const N: usize, const M: usize>
    Workers<F, H, N, M>
{
    /// The thread that steps the filter.
    pub(super) fn one() -> Self {
        Self {
            step: |work| one_by_one(work),
            multiply: |work| one_by_one(work),
            threads: Threads::One,
        }
    }

    /// The threads of the current pool.
    #[cfg(feature = "parallel")]
    pub(super) fn pool() -> Self
    where
        F: Sync,
        H: Sync,
    {
        Self {
            step: |work| on_threads(work),
            multiply: |work| on_threads(work),
            threads: Threads::Pool,
        }
    }
}
