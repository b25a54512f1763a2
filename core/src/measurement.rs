//! Measurements of a target by a receiver: models, their likelihoods, and outliers.

use nalgebra::{SMatrix, SVector};

use crate::{
    Axis, Observation, Pose, Quantity, State, noise,
    noise::log_add,
    parameter::{ParameterError, positive, require},
};

/// A measurement model: what a receiver at a known pose measures of a target in a given state.
///
/// Two methods are required: [`quantities`](Self::quantities) and [`expected`](Self::expected). The
/// rest follow from these, so every model runs under every estimator; override what can be done
/// better.
///
/// ```
/// use foxhunt_core::{MeasurementModel, Pose, Quantity, State};
/// use nalgebra::{Vector1, Vector2};
///
/// /// The distance over ground.
/// struct GroundRange;
///
/// impl MeasurementModel<2, 1> for GroundRange {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::RANGE]
///     }
///
///     fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector1<f64> {
///         Vector1::new((state - receiver.position.xy()).norm())
///     }
/// }
///
/// let range = GroundRange.expected(&Vector2::new(3.0, 4.0), &Pose::default());
/// assert!((range[0] - 5.0).abs() < 1e-12);
/// ```
///
/// # Laws
///
/// Checked by `laws::measurement_model`, feature `laws`: `expected` is finite for every finite
/// state; `residual(z, z) = 0`; a turn of 2π on an [`Axis::Angle`] changes no residual;
/// `expected_change` and `expected_parts` agree with differences of expectations, `jacobian` with
/// finite ones; `log_likelihoods` and `residuals` agree with `log_likelihood` and `residual`; the
/// likelihood integrates to 1 over all measurements.
pub trait MeasurementModel<const N: usize, const M: usize> {
    /// The quantity of each component: its name with its unit, and its geometry. **This method owns
    /// the wrap**: means and residuals in every estimator follow from it.
    fn quantities(&self) -> [Quantity; M];

    /// h(x; pose): the noise-free measurement.
    fn expected(&self, state: &State<N>, receiver: &Pose) -> SVector<f64, M>;

    /// [`expected`](Self::expected) of many states at once; sets `out`, which is as long as
    /// `states`. One state after the other unless overridden, as by a model whose calls cost more
    /// than its sums.
    fn expected_many(&self, states: &[State<N>], receiver: &Pose, out: &mut [SVector<f64, M>]) {
        for (out, state) in out.iter_mut().zip(states) {
            *out = self.expected(state, receiver);
        }
    }

    /// The geometry of each component.
    fn axes(&self) -> [Axis; M] {
        Quantity::axes(&self.quantities())
    }

    /// z ⊖ ẑ, the short way round on each angle.
    fn residual(&self, z: &SVector<f64, M>, expected: &SVector<f64, M>) -> SVector<f64, M> {
        Axis::difference(&self.axes(), z, expected)
    }

    /// h(x + δ) ⊖ h(x) with x the `state`, δ the `offset` and h(x) the `expected` value at x: sigma
    /// points are made of it. A model that has it in a form of its own saves the digits, and often
    /// the time, that a difference of two expectations loses.
    fn expected_change(
        &self,
        state: &State<N>,
        expected: &SVector<f64, M>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> SVector<f64, M> {
        self.residual(&self.expected(&(state + offset), receiver), expected)
    }

    /// The odd and the even part of the [change](Self::expected_change) Δ(δ) over an offset:
    /// (Δ(δ) − Δ(−δ)) / 2 and (Δ(δ) + Δ(−δ)) / 2, which is what filters make of a pair of sigma
    /// points. A form of its own for each saves digits and time once more.
    #[inline(always)]
    fn expected_parts(
        &self,
        state: &State<N>,
        expected: &SVector<f64, M>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> [SVector<f64, M>; 2] {
        let ahead = self.expected_change(state, expected, offset, receiver);
        let behind = self.expected_change(state, expected, &-offset, receiver);
        [(ahead - behind) * 0.5, (ahead + behind) * 0.5]
    }

    /// ∂h/∂x; by central differences unless overridden.
    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, M, N> {
        numeric_jacobian(state, |x| self.expected(x, receiver), |a, b| self.residual(a, b))
    }

    /// ln p(z | x) of the components present, 0 if no component is; Gaussian with the observation's
    /// own covariance unless overridden.
    fn log_likelihood(&self, state: &State<N>, observation: &Observation<M>) -> f64 {
        gaussian_log_likelihood(self, state, observation)
    }

    /// [`log_likelihood`](Self::log_likelihood) of many states at once, held as one column for
    /// each component; sets `out`. Columns and `out` are of one length.
    ///
    /// One state after the other unless overridden. An override is a plain loop over the columns
    /// with the functions of [`elementary`](crate::elementary), and `#[inline(always)]`: a
    /// caller may then compile it for wider vectors.
    #[inline(always)]
    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<M>, out: &mut [f64]) {
        log_likelihoods_one_by_one(self, columns, observation, out);
    }

    /// z ⊖ h(x) of many states at once, held as one column for each component, as are the
    /// residuals; sets `out`. All columns are of one length.
    ///
    /// Overridden as [`log_likelihoods`](Self::log_likelihoods) is.
    #[inline(always)]
    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &SVector<f64, M>,
        receiver: &Pose,
        out: [&mut [f64]; M],
    ) {
        residuals_one_by_one(self, columns, z, receiver, out);
    }
}

/// A Gaussian with a share of outliers, each component of which is spread evenly over its own
/// width: p(r) = (1 − ε) N(r; 0, R) + ε / Π wᵢ, the product over the components that are
/// present.
///
/// An outlier spoils the observation as a whole. A bearing's width is 2π, a level's the span of
/// levels that the receiver can report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlierMixture<const M: usize> {
    share: f64,
    widths: [f64; M],
    log_sound: f64,
    log_share: f64,
}

impl<const M: usize> OutlierMixture<M> {
    /// A mixture with the `share` ε in [0, 1) of outliers, spread over these widths, each in its
    /// component's unit.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the share that is not in [0, 1), or the width that is not positive
    /// and finite.
    pub fn new(share: f64, widths: [f64; M]) -> Result<Self, ParameterError> {
        require((0.0..1.0).contains(&share), "the share of outliers", share, "in [0, 1)")?;
        for width in widths {
            positive("the width of the outliers", width)?;
        }
        Ok(Self { share, widths, log_sound: libm::log1p(-share), log_share: libm::log(share) })
    }

    /// The share ε of outliers.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.share
    }

    /// The two parts of the mixture at an observation, given the Gaussian's log-density of it:
    /// the logarithms of (1 − ε) N and of ε / |Ω|. Their [`log_add`] is the mixture's
    /// log-density.
    #[must_use]
    pub fn log_parts(&self, gaussian: f64, observation: &Observation<M>) -> [f64; 2] {
        let present = self.widths.iter().enumerate().filter(|(i, _)| observation.has(*i));
        let support: f64 = present.map(|(_, width)| width).product();
        [self.log_sound + gaussian, self.log_share + -libm::log(support)]
    }

    /// The mixture's log-density at an observation, given the Gaussian's; 0 for an observation
    /// without components.
    #[must_use]
    pub fn log_density(&self, gaussian: f64, observation: &Observation<M>) -> f64 {
        if observation.is_empty() {
            return 0.0;
        }
        let [sound, outlier] = self.log_parts(gaussian, observation);
        log_add(sound, outlier)
    }
}

/// [`MeasurementModel::residuals`] by one state after the other.
#[inline]
pub fn residuals_one_by_one<const N: usize, const M: usize>(
    model: &(impl MeasurementModel<N, M> + ?Sized),
    columns: [&[f64]; N],
    z: &SVector<f64, M>,
    receiver: &Pose,
    out: [&mut [f64]; M],
) {
    for i in 0..columns[0].len() {
        let state = State::from_fn(|row, _| columns[row][i]);
        let residual = model.residual(z, &model.expected(&state, receiver));
        (0..M).for_each(|row| out[row][i] = residual[row]);
    }
}

/// Computes [`MeasurementModel::log_likelihoods`] one state after the other: for an override that
/// cannot do better for some observations, such as those by an uncertain receiver.
#[inline]
pub fn log_likelihoods_one_by_one<const N: usize, const M: usize>(
    model: &(impl MeasurementModel<N, M> + ?Sized),
    columns: [&[f64]; N],
    observation: &Observation<M>,
    out: &mut [f64],
) {
    for (i, out) in out.iter_mut().enumerate() {
        let state = State::from_fn(|row, _| columns[row][i]);
        *out = model.log_likelihood(&state, observation);
    }
}

/// The observation as it stands for a target in `state`: where the receiver's own place is
/// uncertain, that is part of the noise, R + G Σ Gᵀ with Σ the place's covariance and G the slope
/// of h over it (Bar-Shalom, Li & Kirubarajan 2001, §10.3, to first order), by central
/// differences over one standard deviation.
#[must_use]
pub fn absorb_receiver_noise<const N: usize, const M: usize>(
    model: &(impl MeasurementModel<N, M> + ?Sized),
    state: &State<N>,
    observation: &Observation<M>,
) -> Observation<M> {
    let Some(sigma) = observation.receiver_sigma() else { return *observation };
    let at = |axis: usize, step: f64| {
        let mut receiver = *observation.receiver();
        receiver.position[axis] += step;
        model.expected(state, &receiver)
    };
    let mut more = SMatrix::<f64, M, 3>::zeros();
    for axis in 0..3 {
        let difference = model.residual(&at(axis, sigma[axis]), &at(axis, -sigma[axis]));
        more.set_column(axis, &(difference * 0.5));
    }
    observation.with_more_noise(&more)
}

/// ln N(z ⊖ h(x); 0, R) of the components present, the noise of an uncertain receiver in R, and
/// where directions compete for a bearing the mixture of them: what an override starts from.
#[must_use]
pub fn gaussian_log_likelihood<const N: usize, const M: usize>(
    model: &(impl MeasurementModel<N, M> + ?Sized),
    state: &State<N>,
    observation: &Observation<M>,
) -> f64 {
    let expected = model.expected(state, observation.receiver());
    let residual = model.residual(observation.value(), &expected);
    if observation.is_plain() {
        return observation.log_density(&residual);
    }
    let each = observation.hypotheses().map(|(weight, one)| {
        let one = absorb_receiver_noise(model, state, &one);
        libm::log(weight) + one.log_density(&model.residual(one.value(), &expected))
    });
    each.fold(f64::NEG_INFINITY, noise::log_add)
}

/// The step of a numeric derivative at a component of this value. It balances truncation against
/// rounding: ε^⅓ of the component's size.
pub(crate) fn step(value: f64) -> f64 {
    libm::cbrt(f64::EPSILON) * libm::fmax(1.0, value.abs())
}

/// The places between which a derivative by component `i` is taken.
pub(crate) fn around<const A: usize>(x: &SVector<f64, A>, i: usize) -> [SVector<f64, A>; 2] {
    let step = step(x[i]);
    let mut low = *x;
    let mut high = *x;
    low[i] -= step;
    high[i] += step;
    [low, high]
}

/// The Jacobian of `map` at `x` by central differences; `minus` is ⊖ on its image.
#[must_use]
pub fn numeric_jacobian<const A: usize, const B: usize>(
    x: &SVector<f64, A>,
    map: impl Fn(&SVector<f64, A>) -> SVector<f64, B>,
    minus: impl Fn(&SVector<f64, B>, &SVector<f64, B>) -> SVector<f64, B>,
) -> SMatrix<f64, B, A> {
    let mut jacobian = SMatrix::<f64, B, A>::zeros();
    for i in 0..A {
        let [low, high] = around(x, i);
        jacobian.set_column(i, &(minus(&map(&high), &map(&low)) / (high[i] - low[i])));
    }
    jacobian
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use core::f64::consts::TAU;

    use nalgebra::{Matrix2, Vector2};

    use super::*;
    use crate::Pose;

    fn pair() -> Observation<2> {
        let noise = Matrix2::new(4.0, 0.0, 0.0, 0.01);
        Observation::new(0.0, Pose::default(), Vector2::zeros(), noise).expect("proper")
    }

    #[test]
    fn far_out_only_the_outliers_are_left() {
        let mixture = OutlierMixture::new(0.1, [60.0, TAU]).expect("in range");
        let far = mixture.log_density(-1e6, &pair());
        assert_abs_diff_eq!(far, libm::log(0.1 / (60.0 * TAU)), epsilon = 1e-12);
        let none = OutlierMixture::new(0.0, [60.0, TAU]).expect("in range");
        assert_abs_diff_eq!(none.log_density(-3.0, &pair()), -3.0, epsilon = 1e-15);
    }

    #[test]
    fn between_the_two_parts_the_density_is_their_sum() {
        // (1 − ε) N = 0.75 · 2/3 and ε / |Ω| = 0.25 · 2, so that p = 1.
        let mixture = OutlierMixture::new(0.25, [0.5, 1.0]).expect("in range");
        let log = mixture.log_density(libm::log(2.0 / 3.0), &pair());
        assert_abs_diff_eq!(log, 0.0, epsilon = 1e-15);
    }

    #[test]
    fn a_missing_component_has_no_support() {
        let mixture = OutlierMixture::new(0.1, [60.0, TAU]).expect("in range");
        let bearing = mixture.log_density(-1e6, &pair().without(0));
        assert_abs_diff_eq!(bearing, libm::log(0.1 / TAU), epsilon = 1e-12);
        let level = mixture.log_density(-1e6, &pair().without(1));
        assert_abs_diff_eq!(level, libm::log(0.1 / 60.0), epsilon = 1e-12);
        assert_abs_diff_eq!(
            mixture.log_density(0.0, &pair().without(0).without(1)),
            0.0,
            epsilon = 0.0
        );
    }

    #[test]
    fn what_is_no_mixture_is_refused() {
        for (share, width) in [(1.0, 1.0), (-0.1, 1.0), (f64::NAN, 1.0), (0.1, 0.0), (0.1, -1.0)] {
            assert!(OutlierMixture::new(share, [width]).is_err(), "{share}, {width}");
        }
        assert!(OutlierMixture::new(0.1, [1.0, f64::INFINITY]).is_err());
    }
}
