//! The models of a filter as maps between vector spaces.

use foxhunt_core::{Axis, MeasurementModel, MotionModel, Pose, State};
use nalgebra::{SMatrix, SVector};

use crate::Map;

/// f(·, Δt).
pub(super) struct OverTime<'a, F, const N: usize> {
    motion: &'a F,
    axes: [Axis; N],
    dt: f64,
}

impl<'a, F: MotionModel<N>, const N: usize> OverTime<'a, F, N> {
    pub(super) fn new(motion: &'a F, dt: f64) -> Self {
        Self { motion, axes: motion.axes(), dt }
    }
}

impl<F: MotionModel<N>, const N: usize> Map<N, N> for OverTime<'_, F, N> {
    #[inline(always)]
    fn value(&self, x: &State<N>) -> State<N> {
        self.motion.propagate(x, self.dt)
    }

    #[inline(always)]
    fn jacobian(&self, x: &State<N>) -> SMatrix<f64, N, N> {
        self.motion.jacobian(x, self.dt)
    }

    #[inline(always)]
    fn minus(&self, y: &State<N>, z: &State<N>) -> State<N> {
        Axis::difference(&self.axes, y, z)
    }

    #[inline(always)]
    fn change(&self, x: &State<N>, image: &State<N>, offset: &State<N>) -> State<N> {
        self.motion.propagated_change(x, image, offset, self.dt)
    }
}

/// h(·; pose).
pub(super) struct AtReceiver<'a, H>(pub(super) &'a H, pub(super) &'a Pose);

impl<H: MeasurementModel<N, M>, const N: usize, const M: usize> Map<N, M> for AtReceiver<'_, H> {
    #[inline(always)]
    fn value(&self, x: &State<N>) -> SVector<f64, M> {
        self.0.expected(x, self.1)
    }

    #[inline(always)]
    fn jacobian(&self, x: &State<N>) -> SMatrix<f64, M, N> {
        self.0.jacobian(x, self.1)
    }

    #[inline(always)]
    fn minus(&self, y: &SVector<f64, M>, z: &SVector<f64, M>) -> SVector<f64, M> {
        self.0.residual(y, z)
    }

    #[inline(always)]
    fn change(&self, x: &State<N>, image: &SVector<f64, M>, offset: &State<N>) -> SVector<f64, M> {
        self.0.expected_change(x, image, offset, self.1)
    }

    #[inline(always)]
    fn parts(
        &self,
        x: &State<N>,
        image: &SVector<f64, M>,
        offset: &State<N>,
    ) -> [SVector<f64, M>; 2] {
        self.0.expected_parts(x, image, offset, self.1)
    }
}
