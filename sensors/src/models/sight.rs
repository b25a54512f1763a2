use foxhunt_core::{Pose, State};
use nalgebra::Vector3;

use crate::Propagation;

/// Nearer than this to overhead, in metres, a bearing has no slope. It is far below any
/// position's σ, so only the singularity itself is cut out.
const OVERHEAD: f64 = 1e-3;

/// The way from a receiver to a target, in metres East, North, Up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight(Vector3<f64>);

impl Sight {
    /// From `receiver` to the target in `state` at the height `target_up`.
    pub(super) fn new<const N: usize>(state: &State<N>, receiver: &Pose, target_up: f64) -> Self {
        const { assert!(N >= 2, "a state holds East and North") };
        Self(Vector3::new(state[0], state[1], target_up) - receiver.position)
    }

    /// The slant range.
    pub(super) fn range(&self) -> f64 {
        libm::hypot(self.ground(), self.0.z)
    }

    /// The direction, counter-clockwise from East; 0 exactly overhead.
    pub(super) fn bearing(&self) -> f64 {
        libm::atan2(self.0.y, self.0.x)
    }

    /// ∂P(d)/∂(East, North).
    pub(super) fn power_slope(&self, propagation: &impl Propagation) -> [f64; 2] {
        self.range_slope().map(|along| along * propagation.slope(self.range()))
    }

    /// ∂d/∂(East, North): zero overhead, and where the range overflows.
    pub(super) fn range_slope(&self) -> [f64; 2] {
        let range = self.range();
        if range >= OVERHEAD && range.is_finite() {
            [self.0.x / range, self.0.y / range]
        } else {
            [0.0; 2]
        }
    }

    /// ∂bearing/∂(East, North): zero overhead, where a bearing says nothing.
    pub(super) fn bearing_slope(&self) -> [f64; 2] {
        let ground = self.ground();
        if ground >= OVERHEAD && ground.is_finite() {
            [-self.0.y / ground / ground, self.0.x / ground / ground]
        } else {
            [0.0; 2]
        }
    }

    fn ground(&self) -> f64 {
        libm::hypot(self.0.x, self.0.y)
    }
}
