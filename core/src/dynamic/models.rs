use alloc::{vec, vec::Vec};

use nalgebra::{DMatrix, DVector};

use super::{dynamic, fixed};
use crate::{Axis, MeasurementModel, MotionModel, Pose, Quantity, State};

/// A motion model of a state whose size is known at run time only.
///
/// Two methods are required. A [`MotionModel`] is one by [`Fixed`]. This one makes all parts of a
/// state drift together:
///
/// ```
/// use foxhunt_core::{DynamicMotion, nalgebra::{DMatrix, DVector}};
///
/// /// A random walk that all components have in common, in their unit per √second.
/// struct CommonDrift(f64);
///
/// impl DynamicMotion for CommonDrift {
///     fn propagate(&self, state: &DVector<f64>, _dt: f64) -> DVector<f64> {
///         state.clone()
///     }
///
///     fn noise_factor(&self, state: &DVector<f64>, dt: f64) -> DMatrix<f64> {
///         DMatrix::repeat(state.len(), 1, self.0 * dt.sqrt())
///     }
/// }
///
/// let factor = CommonDrift(0.1).noise_factor(&DVector::zeros(3), 4.0);
/// assert!((&factor * factor.transpose())[(2, 0)] > 0.03);
/// ```
///
/// # Laws
///
/// A model keeps the laws of [`MotionModel`], checked by `laws::motion_model` over
/// [`AtSize`](crate::AtSize).
pub trait DynamicMotion {
    /// f(x, Δt): the state after `dt` seconds without noise.
    fn propagate(&self, state: &DVector<f64>, dt: f64) -> DVector<f64>;

    /// L with L Lᵀ = Q(Δt): a row for each component of the state, and any number of columns.
    fn noise_factor(&self, state: &DVector<f64>, dt: f64) -> DMatrix<f64>;

    /// Returns true if f(x, Δt) = F x with the [`jacobian`](Self::jacobian) F.
    fn is_linear(&self) -> bool {
        false
    }

    /// The geometry of each component of a state of `dimension` components.
    fn axes(&self, dimension: usize) -> Vec<Axis> {
        vec![Axis::Linear; dimension]
    }

    /// ∂f/∂x; by central differences unless overridden.
    fn jacobian(&self, state: &DVector<f64>, dt: f64) -> DMatrix<f64> {
        let axes = self.axes(state.len());
        numeric_jacobian(state, |x| self.propagate(x, dt), |a, b| difference(&axes, a, b))
    }

    /// The odd and the even part of the change over an offset δ: (Δ(δ) − Δ(−δ)) / 2 and
    /// (Δ(δ) + Δ(−δ)) / 2 with Δ(δ) = f(x + δ, Δt) ⊖ f(x, Δt), where x is the `state` and f(x, Δt)
    /// is where it is `propagated` to.
    fn propagated_parts(
        &self,
        state: &DVector<f64>,
        propagated: &DVector<f64>,
        offset: &DVector<f64>,
        dt: f64,
    ) -> [DVector<f64>; 2] {
        let axes = self.axes(state.len());
        let change =
            |moved: DVector<f64>| difference(&axes, &self.propagate(&moved, dt), propagated);
        halves(&change(state + offset), &change(state - offset))
    }
}

/// A measurement model over a state whose size is known at run time only.
///
/// Two methods are required, as of a [`MeasurementModel`], which is one by [`On`]. This one
/// measures all components at once:
///
/// ```
/// use foxhunt_core::{DynamicMeasurement, Pose, Quantity, nalgebra::DVector};
///
/// /// The mean of all offsets, which a reference receiver measures.
/// struct MeanOffset;
///
/// impl DynamicMeasurement for MeanOffset {
///     fn quantities(&self) -> Vec<Quantity> {
///         vec![Quantity::linear("offset_db")]
///     }
///
///     fn expected(&self, state: &DVector<f64>, _receiver: &Pose) -> DVector<f64> {
///         DVector::from_element(1, state.mean())
///     }
/// }
///
/// let slope = MeanOffset.jacobian(&DVector::zeros(4), &Pose::default());
/// assert!((slope[(0, 3)] - 0.25).abs() < 1e-9);
/// ```
///
/// # Laws
///
/// A model keeps the laws of [`MeasurementModel`], checked by `laws::measurement_model` over
/// [`AtSize`](crate::AtSize).
pub trait DynamicMeasurement {
    /// The quantity of each component of a measurement.
    fn quantities(&self) -> Vec<Quantity>;

    /// h(x; pose): the noise-free measurement. The state has the
    /// [`components`](Self::components) that the model names, and no others.
    fn expected(&self, state: &DVector<f64>, receiver: &Pose) -> DVector<f64>;

    /// The components of the joint state that the model is over, in its own order; `None` is all
    /// of them. Naming few makes an update cheap: its linearisation is over these alone, and the
    /// rest follows by their covariance, which loses nothing.
    fn components(&self) -> Option<&[usize]> {
        None
    }

    /// z ⊖ ẑ, the short way round on each angle.
    fn residual(&self, z: &DVector<f64>, expected: &DVector<f64>) -> DVector<f64> {
        let axes: Vec<Axis> = self.quantities().iter().map(Quantity::axis).collect();
        difference(&axes, z, expected)
    }

    /// ∂h/∂x; by central differences unless overridden.
    fn jacobian(&self, state: &DVector<f64>, receiver: &Pose) -> DMatrix<f64> {
        numeric_jacobian(state, |x| self.expected(x, receiver), |a, b| self.residual(a, b))
    }

    /// The odd and the even part of the change of the measurement over an offset, as
    /// [`MeasurementModel::expected_parts`].
    fn expected_parts(
        &self,
        state: &DVector<f64>,
        expected: &DVector<f64>,
        offset: &DVector<f64>,
        receiver: &Pose,
    ) -> [DVector<f64>; 2] {
        let change = |x: DVector<f64>| self.residual(&self.expected(&x, receiver), expected);
        halves(&change(state + offset), &change(state - offset))
    }
}

/// A [`MotionModel`] of `N` components as a [`DynamicMotion`].
///
/// # Panics
///
/// Its methods, for a state that has not `N` components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fixed<F, const N: usize>(pub F);

impl<F: MotionModel<N>, const N: usize> DynamicMotion for Fixed<F, N> {
    fn propagate(&self, state: &DVector<f64>, dt: f64) -> DVector<f64> {
        dynamic(&self.0.propagate(&fixed(state), dt))
    }

    fn noise_factor(&self, state: &DVector<f64>, dt: f64) -> DMatrix<f64> {
        let factor = self.0.noise_factor(&fixed(state), dt);
        DMatrix::from_column_slice(N, N, factor.as_slice())
    }

    fn is_linear(&self) -> bool {
        self.0.is_linear()
    }

    fn axes(&self, _dimension: usize) -> Vec<Axis> {
        self.0.axes().to_vec()
    }

    fn jacobian(&self, state: &DVector<f64>, dt: f64) -> DMatrix<f64> {
        DMatrix::from_column_slice(N, N, self.0.jacobian(&fixed(state), dt).as_slice())
    }

    fn propagated_parts(
        &self,
        state: &DVector<f64>,
        propagated: &DVector<f64>,
        offset: &DVector<f64>,
        dt: f64,
    ) -> [DVector<f64>; 2] {
        let state: State<N> = fixed(state);
        let propagated = fixed(propagated);
        let offset: State<N> = fixed(offset);
        let ahead = self.0.propagated_change(&state, &propagated, &offset, dt);
        let behind = self.0.propagated_change(&state, &propagated, &-offset, dt);
        halves(&dynamic(&ahead), &dynamic(&behind))
    }
}

/// A [`MeasurementModel`] of `N` components that it takes from a larger state, be they all of one
/// block or of several.
///
/// ```
/// use foxhunt_core::{DynamicMeasurement, MeasurementModel, On, Pose, Quantity, State,
///     nalgebra::{DVector, Vector1}};
///
/// /// A level that a station reports with its own offset: x = (level, offset).
/// struct OffsetLevel;
///
/// impl MeasurementModel<2, 1> for OffsetLevel {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::RSS]
///     }
///     fn expected(&self, state: &State<2>, _receiver: &Pose) -> Vector1<f64> {
///         Vector1::new(state[0] + state[1])
///     }
/// }
///
/// let by_third_station = On::new(OffsetLevel, [0, 3]);
/// assert_eq!(by_third_station.components(), Some(&[0, 3][..]));
/// let own = DVector::from_column_slice(&[-60.0, 2.5]);
/// assert_eq!(by_third_station.expected(&own, &Pose::default())[0], -57.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct On<H, const N: usize, const M: usize> {
    model: H,
    components: [usize; N],
}

impl<H: MeasurementModel<N, M>, const N: usize, const M: usize> On<H, N, M> {
    /// The model over these components of the joint state, in the order of its own state.
    #[must_use]
    pub fn new(model: H, components: [usize; N]) -> Self {
        Self { model, components }
    }
}

impl<H: MeasurementModel<N, M>, const N: usize, const M: usize> DynamicMeasurement for On<H, N, M> {
    fn quantities(&self) -> Vec<Quantity> {
        self.model.quantities().to_vec()
    }

    fn expected(&self, state: &DVector<f64>, receiver: &Pose) -> DVector<f64> {
        dynamic(&self.model.expected(&fixed(state), receiver))
    }

    fn components(&self) -> Option<&[usize]> {
        Some(&self.components)
    }

    fn residual(&self, z: &DVector<f64>, expected: &DVector<f64>) -> DVector<f64> {
        dynamic(&self.model.residual(&fixed(z), &fixed(expected)))
    }

    fn jacobian(&self, state: &DVector<f64>, receiver: &Pose) -> DMatrix<f64> {
        let jacobian = self.model.jacobian(&fixed(state), receiver);
        DMatrix::from_column_slice(M, N, jacobian.as_slice())
    }

    fn expected_parts(
        &self,
        state: &DVector<f64>,
        expected: &DVector<f64>,
        offset: &DVector<f64>,
        receiver: &Pose,
    ) -> [DVector<f64>; 2] {
        let parts =
            self.model.expected_parts(&fixed(state), &fixed(expected), &fixed(offset), receiver);
        parts.map(|part| dynamic(&part))
    }
}

/// Half the difference and half the sum.
#[inline]
fn halves(ahead: &DVector<f64>, behind: &DVector<f64>) -> [DVector<f64>; 2] {
    [(ahead - behind) * 0.5, (ahead + behind) * 0.5]
}

/// `a ⊖ b` on each axis that both have: a caller finds a length that does not fit.
#[inline]
fn difference(axes: &[Axis], a: &DVector<f64>, b: &DVector<f64>) -> DVector<f64> {
    let each = axes.iter().zip(a.iter().zip(b)).map(|(axis, (a, b))| axis.minus(*a, *b));
    DVector::from_vec(each.collect())
}

/// The Jacobian of `map` at `x` by central differences, with the steps of
/// [`numeric_jacobian`](crate::numeric_jacobian).
fn numeric_jacobian(
    x: &DVector<f64>,
    map: impl Fn(&DVector<f64>) -> DVector<f64>,
    minus: impl Fn(&DVector<f64>, &DVector<f64>) -> DVector<f64>,
) -> DMatrix<f64> {
    let mut slopes = Vec::new();
    for i in 0..x.len() {
        let step = crate::measurement::step(x[i]);
        let mut low = x.clone();
        let mut high = x.clone();
        low[i] -= step;
        high[i] += step;
        let change = minus(&map(&high), &map(&low));
        slopes.extend(change.iter().map(|value| value / (high[i] - low[i])));
    }
    let rows = slopes.len() / x.len().max(1);
    DMatrix::from_vec(rows, x.len(), slopes)
}
