use foxhunt_core::{MeasurementModel, Pose, State, elementary};
use nalgebra::{SVector, Vector3};

use crate::{Propagation, near_zero};

/// Nearer than this to overhead, in metres, a bearing has no slope. It is far below any
/// position's σ, so only the singularity itself is cut out.
const OVERHEAD: f64 = 1e-3;

/// The way from a receiver to a target, in metres East, North, Up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight(Vector3<f64>);

/// h(x + δ) ⊖ h(x), one by one; apart from where it is rarely called.
#[cold]
#[inline(never)]
pub(super) fn difference<const N: usize, const M: usize>(
    model: &impl MeasurementModel<N, M>,
    state: &State<N>,
    expected: &SVector<f64, M>,
    offset: &State<N>,
    receiver: &Pose,
) -> SVector<f64, M> {
    model.residual(&model.expected(&(state + offset), receiver), expected)
}

impl Sight {
    /// From `receiver` to the target in `state` at the height `target_up`.
    #[inline]
    pub(super) fn new<const N: usize>(state: &State<N>, receiver: &Pose, target_up: f64) -> Self {
        const { assert!(N >= 2, "a state holds East and North") };
        Self(Vector3::new(state[0], state[1], target_up) - receiver.position)
    }

    /// The slant range.
    #[inline]
    pub(super) fn range(&self) -> f64 {
        let square = self.0.norm_squared();
        // Between, no square is lost that would count.
        if (1e-200..1e300).contains(&square) { libm::sqrt(square) } else { self.odd_range() }
    }

    #[cold]
    fn odd_range(&self) -> f64 {
        libm::hypot(libm::hypot(self.0.x, self.0.y), self.0.z)
    }

    /// The direction, counter-clockwise from East; 0 exactly overhead.
    #[inline]
    pub(super) fn bearing(&self) -> f64 {
        let (x, y) = (self.0.x, self.0.y);
        if x.abs() + y.abs() < 1e300 { elementary::atan2(y, x) } else { libm::atan2(y, x) }
    }

    /// What becomes of range and bearing when the target moves by so much: how much the square of
    /// the range grows, as a share of it, and how far the bearing turns. `None` where the two
    /// places had better be looked at one by one: near overhead, beyond the largest numbers, and
    /// where the target goes more than half as far as it is away over ground.
    #[inline(always)]
    pub(super) fn change(&self, east: f64, north: f64) -> Option<(f64, f64)> {
        let (x, y) = (self.0.x, self.0.y);
        let (ground, moved) = (self.ground_squared(), east * east + north * north);
        // The same for both points of a pair, as are the quotients for all points about one.
        let plain = moved <= 0.25 * ground && (4.0 * OVERHEAD * OVERHEAD..1e300).contains(&ground);
        let scale = 1.0 / self.0.norm_squared();
        let (forth, across) = (x * east + y * north, x * north - y * east);
        let growth = (forth + forth + moved) * scale;
        plain.then(|| (growth, near_zero::atan(across / (ground + forth))))
    }

    /// ∂P(d)/∂(East, North).
    pub(super) fn power_slope(&self, propagation: &impl Propagation) -> [f64; 2] {
        self.range_slope().map(|along| along * propagation.slope(self.range()))
    }

    /// ∂d/∂(East, North): zero overhead, and where the range overflows.
    #[inline]
    pub(super) fn range_slope(&self) -> [f64; 2] {
        let range = self.range();
        if (OVERHEAD..=f64::MAX).contains(&range) {
            let inverse = 1.0 / range;
            [self.0.x * inverse, self.0.y * inverse]
        } else {
            [0.0; 2]
        }
    }

    /// ∂bearing/∂(East, North): zero overhead, where no bearing is defined, and where the square
    /// of the range overflows, where it turns by nothing.
    #[inline]
    pub(super) fn bearing_slope(&self) -> [f64; 2] {
        let ground = self.ground_squared();
        if (OVERHEAD * OVERHEAD..=f64::MAX).contains(&ground) {
            let inverse = 1.0 / ground;
            [-self.0.y * inverse, self.0.x * inverse]
        } else {
            [0.0; 2]
        }
    }

    fn ground_squared(&self) -> f64 {
        self.0.x * self.0.x + self.0.y * self.0.y
    }
}
