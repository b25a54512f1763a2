//! Laws of models, and of the estimators that use them.

use core::{any::type_name, f64::consts::TAU};

use nalgebra::{SMatrix, SVector};

use crate::{
    Axis, BearingMode, BearingModes, Correction, Estimator, MeasurementModel, MotionModel,
    Observation, Pose, Smooth, State, columns,
    laws::predictive::{self, Act, Fresh, Predictive},
    measurement::around,
    noise::log_add,
    numeric_jacobian,
};

/// Laws that [`estimator_with`] checks on an estimator, and their tolerances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checks {
    /// The length of the predicted step, in seconds.
    pub step: f64,
    /// Largest distance, as a share of the belief's spread, of the posterior with a component of a
    /// variance of 10¹⁵ from that without the component. `None` leaves this law out: a model of
    /// outliers takes such an observation for one, so that it differs from a missing component.
    pub worthless_tolerance: Option<f64>,
    /// Laws over all observations that may come. `None` leaves them out: for problems at which an
    /// estimator's approximation is coarse.
    pub predictive: Option<Predictive>,
}

impl Checks {
    /// The laws at one observation, without those over all that may come.
    pub const AT_ONE_OBSERVATION: Self =
        Self { step: 1.0, worthless_tolerance: Some(1e-6), predictive: None };
}

/// A step of 1 s; a worthless component is a missing one, to 10⁻⁶; laws over all observations.
impl Default for Checks {
    fn default() -> Self {
        Self { predictive: Some(Predictive::default()), ..Self::AT_ONE_OBSERVATION }
    }
}

/// A motion model's laws at one state and one step.
///
/// # Panics
///
/// On a breach.
pub fn motion_model<const N: usize>(model: &impl MotionModel<N>, state: &State<N>, dt: f64) {
    any_motion_model(model, state, dt);
}

fn any_motion_model<const N: usize>(model: &dyn MotionModel<N>, state: &State<N>, dt: f64) {
    let axes = model.axes();
    let minus = |a: &State<N>, b: &State<N>| Axis::difference(&axes, a, b);
    let still = minus(&model.propagate(state, 0.0), state).norm();
    assert!(still <= 1e-12 * (1.0 + state.norm()), "no time moved the state by {still}");
    let none = model.noise_factor(state, 0.0).norm();
    assert!(none < 1e-12, "no time made noise: {none}");
    let factor = model.noise_factor(state, dt);
    assert!(factor.iter().all(|v| v.is_finite()), "the noise factor is not finite: {factor:?}");

    let propagated = model.propagate(state, dt);
    let offset = State::repeat(1e-3);
    let change = model.propagated_change(state, &propagated, &offset, dt);
    let difference = minus(&model.propagate(&(state + offset), dt), &propagated);
    let error = minus(&change, &difference).norm();
    assert!(error <= 1e-9 * (1.0 + propagated.norm()), "propagated_change is off by {error}");

    let numeric = numeric_jacobian(state, |x| model.propagate(x, dt), minus);
    let error = (model.jacobian(state, dt) - numeric).norm();
    assert!(error <= 1e-6 * (1.0 + numeric.norm()), "the jacobian is off by {error}");

    if model.is_linear() {
        let error = minus(&(model.jacobian(state, dt) * state), &propagated).norm();
        assert!(error <= 1e-12 * (1.0 + propagated.norm()), "F x is off by {error}");
    }

    // Three states at once: each from its own column and with its own noise.
    let states = [*state, state * 0.5, -state];
    let white = [1.0, -0.3, 2.0]
        .map(|draw| State::from_fn(|row, _| if row % 2 == 0 { draw } else { 0.7 - draw }));
    let column = |states: &[State<N>; 3]| -> [[f64; 3]; N] {
        core::array::from_fn(|row| states.map(|state| state[row]))
    };
    let mut moved = column(&states);
    let noise = column(&white);
    model.move_columns(columns::slices_mut(&mut moved), columns::slices(&noise), dt);
    for (i, (state, white)) in states.iter().zip(&white).enumerate() {
        let one = model.propagate(state, dt) + model.noise_factor(state, dt) * white;
        let all = State::from_fn(|row, _| moved[row][i]);
        let error = minus(&all, &one).norm();
        assert!(error <= 1e-12 * (1.0 + one.norm()), "columns are moved elsewhere, by {error}");
    }
}

/// A measurement model's laws at one state and one observation, and that its likelihood is a
/// density: ∫ p(z | x) dz = 1 over the components that are present. A Gaussian of the short way
/// round may lack its own tails beyond half a turn.
///
/// # Panics
///
/// On a breach.
pub fn measurement_model<const N: usize, const M: usize>(
    model: &impl MeasurementModel<N, M>,
    state: &State<N>,
    observation: &Observation<M>,
) {
    measurement_model_at_one_observation(model, state, observation);
    predictive::likelihood_is_a_density(type_name_of(model), model, state, observation);
}

fn type_name_of<T>(_: &T) -> &'static str {
    type_name::<T>()
}

/// A measurement model's laws at one state and one observation, without the integral over all
/// observations: for a likelihood that is no density over an endless axis, as outliers spread
/// evenly over a width of levels make it.
///
/// # Panics
///
/// On a breach.
pub fn measurement_model_at_one_observation<const N: usize, const M: usize>(
    model: &impl MeasurementModel<N, M>,
    state: &State<N>,
    observation: &Observation<M>,
) {
    any_measurement_model(model, state, observation);
}

fn any_measurement_model<const N: usize, const M: usize>(
    model: &dyn MeasurementModel<N, M>,
    state: &State<N>,
    observation: &Observation<M>,
) {
    for quantity in model.quantities() {
        let is_in_degrees = quantity.axis() == Axis::Angle && quantity.name().ends_with("_deg");
        assert!(!is_in_degrees, "{} wraps at a turn of 2π: give it in radians", quantity.name());
    }
    let receiver = observation.receiver();
    let expected = model.expected(state, receiver);
    assert!(expected.iter().all(|v| v.is_finite()), "expected is not finite: {expected:?}");

    let none = model.residual(&expected, &expected);
    assert!(none.norm() < 1e-12, "a measurement differs from itself: {none:?}");

    let mut turned = expected;
    for (component, axis) in model.axes().iter().enumerate() {
        if *axis == Axis::Angle {
            turned[component] += TAU;
        }
    }
    let turn = model.residual(&turned, &expected);
    assert!(turn.norm() < 1e-9, "a full turn makes a residual: {turn:?}");

    walk_round(model, state, receiver);

    for size in [1e-3, 1.0] {
        let offset = State::from_fn(|i, _| if i % 2 == 0 { size } else { -0.7 * size });
        let change = model.expected_change(state, &expected, &offset, receiver);
        let difference = model.residual(&model.expected(&(state + offset), receiver), &expected);
        let error = model.residual(&change, &difference).norm();
        let room = 1e-9 * (1.0 + expected.norm() + difference.norm());
        assert!(error <= room, "expected_change is off by {error}");
        let behind = model.expected_change(state, &expected, &-offset, receiver);
        let [odd, even] = model.expected_parts(state, &expected, &offset, receiver);
        let error = (odd + even - change).norm() + (even - odd - behind).norm();
        assert!(error <= 2.0 * room, "expected_parts are off by {error}");
    }

    let numeric =
        numeric_jacobian(state, |x| model.expected(x, receiver), |a, b| model.residual(a, b));
    // A central difference is the derivative's mean between its places, here by Simpson's rule: near
    // a null that is not the derivative in the middle.
    let mut jacobian = model.jacobian(state, receiver);
    for i in 0..N {
        let [low, high] = around(state, i).map(|x| model.jacobian(&x, receiver));
        let mean = (jacobian.column(i) * 4.0 + low.column(i) + high.column(i)) / 6.0;
        jacobian.set_column(i, &mean);
    }
    let error = (jacobian - numeric).norm();
    assert!(
        error <= 1e-6 * (1.0 + numeric.norm()),
        "the jacobian is off by {error}: it is {jacobian:?}, central differences give {numeric:?}"
    );

    likelihoods(model, state, observation);
    for bearing in 0..M {
        if model.axes()[bearing] == Axis::Angle && observation.has(bearing) {
            let angle = observation.value()[bearing];
            let mode = |weight, angle, sigma| BearingMode { weight, angle, sigma };
            let modes = [mode(2.0, angle, 0.2), mode(1.0, angle + 1.0, 0.3)];
            let modes = BearingModes::new(&modes).expect("two proper directions");
            let several = observation.with_bearing_modes(bearing, modes);
            likelihoods(model, state, &several);
            let sigma = nalgebra::Vector3::new(0.5, 0.3, 0.2);
            let several = several.with_receiver_sigma(sigma).expect("a proper place");
            likelihoods(model, state, &several);
            let likelihood = model.log_likelihood(state, &several);
            let mixture = several
                .hypotheses()
                .map(|(weight, one)| libm::log(weight) + model.log_likelihood(state, &one))
                .fold(f64::NEG_INFINITY, log_add);
            assert!(
                (likelihood - mixture).abs() <= 1e-9 * (1.0 + mixture.abs()),
                "two directions are {likelihood} likely, as a mixture {mixture}"
            );
        }
    }
    let empty = (0..M).fold(*observation, Observation::without);
    let nothing = model.log_likelihood(state, &empty);
    assert!(nothing.abs() < 1e-12, "an empty observation has the log-likelihood {nothing}");
}

/// Asserts that the log-likelihoods and residuals of many states equal each state's own.
fn likelihoods<const N: usize, const M: usize>(
    model: &dyn MeasurementModel<N, M>,
    state: &State<N>,
    observation: &Observation<M>,
) {
    let nearby = state.add_scalar(1.0);
    let pairs: [[f64; 2]; N] = core::array::from_fn(|row| [state[row], nearby[row]]);
    let columns: [&[f64]; N] = core::array::from_fn(|row| &pairs[row][..]);
    let mut out = [f64::NAN; 2];
    model.log_likelihoods(columns, observation, &mut out);
    for (x, many) in [*state, nearby].iter().zip(out) {
        let one = model.log_likelihood(x, observation);
        assert!(
            (one - many).abs() <= 1e-9 * (1.0 + one.abs()),
            "log_likelihoods is {many}, log_likelihood {one}"
        );
    }
    let mut rows = [[f64::NAN; 2]; M];
    let z = observation.value();
    let receiver = observation.receiver();
    model.residuals(columns, z, receiver, columns::slices_mut(&mut rows));
    for (i, x) in [*state, nearby].iter().enumerate() {
        let many = SVector::<f64, M>::from_fn(|row, _| rows[row][i]);
        let one = model.residual(z, &model.expected(x, receiver));
        // An angle just behind may be −π or π.
        let off = model.residual(&many, &one).norm();
        assert!(off <= 1e-9 * (1.0 + one.norm()), "residuals is {many:?}, residual {one:?}");
    }
}

/// A model that calls an angle linear keeps the other laws; on a walk round the receiver it jumps.
fn walk_round<const N: usize, const M: usize>(
    model: &dyn MeasurementModel<N, M>,
    state: &State<N>,
    receiver: &Pose,
) {
    const STEPS: u16 = 360;
    // The narrowest null of an antenna is wider than a degree over 2^20.
    const HALVINGS: u8 = 20;
    let place = |step: f64| {
        let angle = TAU * step / f64::from(STEPS);
        let mut x = *state;
        x[0] = receiver.position.x + 50.0 * libm::cos(angle);
        x[1] = receiver.position.y + 50.0 * libm::sin(angle);
        model.expected(&x, receiver)
    };
    let stride = |from: f64, to: f64| model.residual(&place(to), &place(from)).norm();
    let strides = || (0..STEPS).map(f64::from).map(|step| (step, stride(step, step + 1.0)));
    let path: f64 = strides().map(|(_, stride)| stride).sum();
    let longest = |a: (f64, f64), b: (f64, f64)| if b.1 > a.1 { b } else { a };
    let (mut from, jump) = strides().fold((0.0, 0.0), longest);
    if jump <= path / f64::from(STEPS) * 8.0 + 1e-9 {
        return;
    }
    // A null is steep, too, but a part of its stride is shorter than the whole of it.
    let mut width = 1.0;
    let mut rest = jump;
    for _ in 0..HALVINGS {
        width /= 2.0;
        let middle = from + width;
        let halves = [(from, stride(from, middle)), (middle, stride(middle, middle + width))];
        (from, rest) = longest(halves[0], halves[1]);
    }
    assert!(rest < 0.1 * jump, "expected jumps by {jump} on a walk round the receiver");
}

/// An estimator's laws at one observation, by the default [`Checks`]. `fresh` makes the same
/// estimator each time.
///
/// # Panics
///
/// On a breach.
pub fn estimator<E: Estimator<N, M>, const N: usize, const M: usize>(
    fresh: impl Fn() -> E,
    observation: &Observation<M>,
) {
    estimator_with(fresh, observation, Checks::default());
}

/// An estimator's laws at one observation. `fresh` makes the same estimator each time.
///
/// # Panics
///
/// On a breach; the message begins with the estimator's type.
pub fn estimator_with<E: Estimator<N, M>, const N: usize, const M: usize>(
    fresh: impl Fn() -> E,
    observation: &Observation<M>,
    checks: Checks,
) {
    let lend = |act: &mut Act<'_, N, M>| act(&mut fresh());
    any_estimator(&Fresh { name: type_name::<E>(), lend: &lend }, observation, checks);
}

fn any_estimator<const N: usize, const M: usize>(
    fresh: &Fresh<'_, N, M>,
    observation: &Observation<M>,
    checks: Checks,
) {
    let name = fresh.name;
    empty_observation_changes_nothing(fresh, observation);
    for component in 0..M {
        missing_component_is_not_read(fresh, observation, component, checks);
        whole_turn_changes_nothing(fresh, observation, component);
    }
    fresh.predicted(checks.step, |updated| {
        let predicted = updated.estimate();
        if updated.update(observation).is_err() {
            let left = updated.estimate() == predicted;
            assert!(left, "{name}: a refused observation changed the belief");
            return;
        }
        let p = updated.estimate().covariance;
        let skew: SMatrix<f64, N, N> = p - p.transpose();
        assert!(skew.norm() <= 1e-9 * p.norm(), "{name}: the covariance is not symmetric: {p:?}");
        let definite = p.cholesky().is_some();
        assert!(definite, "{name}: the covariance is not positive definite: {p:?}");
        samples_represent_the_belief(name, updated);
    });
    let before = fresh.lent(|estimator| estimator.estimate());
    for step in [-1.0, f64::NAN, f64::INFINITY] {
        fresh.lent(|refused| {
            assert!(refused.predict(step).is_err(), "{name}: a step of {step} s was accepted");
            let left = refused.estimate() == before;
            assert!(left, "{name}: a refused step of {step} s changed the belief");
        });
    }
    if let Some(laws) = &checks.predictive {
        predictive::predictive(fresh, observation, checks.step, laws);
    }
}

/// An angle and the same angle a turn on are one measurement.
fn whole_turn_changes_nothing<const N: usize, const M: usize>(
    fresh: &Fresh<'_, N, M>,
    observation: &Observation<M>,
    component: usize,
) {
    let name = fresh.name;
    let angle = fresh.lent(|e| e.quantities()[component].axis() == Axis::Angle);
    if !angle || !observation.has(component) {
        return;
    }
    let posterior = |turns: f64| {
        let mut value = *observation.value();
        value[component] += turns * TAU;
        let turned = predictive::moved(observation, value);
        fresh.lent(|estimator| (estimator.update(&turned), estimator.estimate()))
    };
    let (correction, plain) = posterior(0.0);
    for turns in [-1.0, 1.0] {
        let (turned, estimate) = posterior(turns);
        let equal = |a: f64, b: f64| (a - b).abs() <= 1e-6 * (1.0 + a.abs());
        let alike = match (correction, turned) {
            (Ok(a), Ok(b)) => {
                let evidence = |c: Correction| match c {
                    Correction::Fused { log_evidence, .. } => Some(log_evidence),
                    _ => None,
                };
                let alike = |a: Option<f64>, b| match (a, b) {
                    (Some(a), Some(b)) => equal(a, b),
                    (a, b) => a.is_none() && b.is_none(),
                };
                alike(a.nis(), b.nis()) && alike(evidence(a), evidence(b))
            }
            (a, b) => a.is_err() && b.is_err(),
        };
        let spread = plain.covariance.trace();
        let mean = (estimate.mean - plain.mean).norm() / libm::sqrt(spread);
        let covariance = (estimate.covariance - plain.covariance).norm() / spread;
        assert!(
            alike && mean < 1e-6 && covariance < 1e-6,
            "{name}: component {component} plus {turns} turns gives another posterior: the mean \
             is off by {mean} of its σ, the covariance by {covariance}, {turned:?}, not \
             {correction:?}"
        );
    }
}

/// A smoother's laws after one observation, and a step of `dt` seconds. `fresh` makes the same
/// estimator each time. `tolerance` is a share of the belief's spread: rounding for Gaussians, the
/// Monte Carlo error for a cloud, the resolution for cells.
///
/// # Panics
///
/// On a breach; the message begins with the estimator's type.
pub fn smoother<E: Smooth<N, M> + Clone, const N: usize, const M: usize>(
    fresh: impl Fn() -> E,
    observation: &Observation<M>,
    dt: f64,
    tolerance: f64,
) {
    let name = type_name::<E>();
    let mut earlier = fresh();
    if let Err(error) = earlier.update(observation) {
        panic!("{name}: the observation was refused: {error}");
    }
    let mut later = earlier.clone();
    if let Err(error) = later.predict(dt) {
        panic!("{name}: a step of {dt} s was refused: {error}");
    }
    let before = earlier.estimate();
    for step in [-1.0, f64::NAN, f64::INFINITY] {
        let mut refused = earlier.clone();
        assert!(refused.smooth(&later, step).is_err(), "{name}: a step of {step} s was accepted");
        let left = refused.estimate() == before;
        assert!(left, "{name}: a refused step of {step} s changed the belief");
    }
    if let Err(error) = earlier.smooth(&later, dt) {
        panic!("{name}: there is no smoother: {error}");
    }
    let after = earlier.estimate();
    let root = before.covariance.cholesky().map(|root| root.unpack());
    let Some(root) = root else { panic!("{name}: the covariance is not positive definite") };
    let is_finite = after.mean.iter().chain(&after.covariance).all(|value| value.is_finite());
    assert!(is_finite, "{name}: the smoothed mean or covariance is not finite");
    let mean = root.solve_lower_triangular_unchecked(&(after.mean - before.mean)).amax();
    let half = root.solve_lower_triangular_unchecked(&(after.covariance - before.covariance));
    let covariance = root.solve_lower_triangular_unchecked(&half.transpose()).amax();
    assert!(
        mean <= tolerance && covariance <= tolerance,
        "{name}: a later belief without news moved the mean by {mean} of its σ and the \
         covariance by {covariance} of it"
    );
    samples_represent_the_belief(name, &earlier);
}

fn empty_observation_changes_nothing<const N: usize, const M: usize>(
    fresh: &Fresh<'_, N, M>,
    observation: &Observation<M>,
) {
    let name = fresh.name;
    let empty = (0..M).fold(*observation, Observation::without);
    let (correction, after) = fresh.lent(|idle| (idle.update(&empty), idle.estimate()));
    assert_eq!(correction, Ok(Correction::Empty), "{name}: an observation without components");
    let left = after == fresh.lent(|estimator| estimator.estimate());
    assert!(left, "{name}: an empty observation changed the belief");
}

fn missing_component_is_not_read<const N: usize, const M: usize>(
    fresh: &Fresh<'_, N, M>,
    observation: &Observation<M>,
    component: usize,
    checks: Checks,
) {
    let name = fresh.name;
    let posterior = |shift: f64, present: bool, variance: f64| {
        let mut value = *observation.value();
        let mut noise = observation.noise();
        value[component] += shift;
        noise.row_mut(component).fill(0.0);
        noise.column_mut(component).fill(0.0);
        noise[(component, component)] = variance;
        let whole = Observation::new(observation.time(), *observation.receiver(), value, noise)
            .expect("a shifted value is finite and the noise was decoupled");
        let observation = if present { whole } else { whole.without(component) };
        fresh.lent(|estimator| {
            let correction = estimator.update(&observation);
            (estimator.estimate(), matches!(correction, Ok(Correction::Rejected { .. })))
        })
    };
    let (missing, rejected) = posterior(0.0, false, 1.0);
    let unread = (missing, rejected) == posterior(1.0, false, 1.0);
    assert!(unread, "{name}: missing component {component} was read");

    let Some(tolerance) = checks.worthless_tolerance else { return };
    // A gate's limit depends on how many components there are, so it may judge these two apart.
    let (worthless, worthless_rejected) = posterior(0.0, true, 1e15);
    let before = fresh.lent(|estimator| estimator.estimate()).covariance;
    let error = (missing.mean - worthless.mean).norm() / before.trace()
        + (missing.covariance - worthless.covariance).norm() / before.norm();
    assert!(
        rejected || worthless_rejected || error < tolerance,
        "{name}: missing component {component} still has an effect: {error}"
    );
}

fn samples_represent_the_belief<const N: usize, const M: usize>(
    name: &str,
    estimator: &dyn Estimator<N, M>,
) {
    let estimate = estimator.estimate();
    let mut total = 0.0;
    let mut mean = estimate.mean * 0.0;
    estimator.visit_samples(&mut |x, w| {
        total += w;
        mean += (x - estimate.mean) * w;
    });
    assert!((total - 1.0).abs() < 1e-9, "{name}: the samples' weights sum to {total}");
    let error = mean.norm() / (1.0 + libm::sqrt(estimate.covariance.trace()));
    assert!(error < 1e-6, "{name}: the samples' mean is off by {error} of the belief's spread");
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix1, Matrix1x2, Vector1, Vector2};

    use super::*;
    use crate::Quantity;

    /// A bearing that is held to be a range.
    struct Linear;

    impl MeasurementModel<2, 1> for Linear {
        fn quantities(&self) -> [Quantity; 1] {
            [Quantity::RANGE]
        }

        fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector1<f64> {
            let sight = state - receiver.position.xy();
            Vector1::new(libm::atan2(sight.y, sight.x))
        }
    }

    /// A range whose derivative is 0.01 % too long.
    struct Steep;

    impl MeasurementModel<2, 1> for Steep {
        fn quantities(&self) -> [Quantity; 1] {
            [Quantity::RANGE]
        }

        fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector1<f64> {
            Vector1::new((state - receiver.position.xy()).norm())
        }

        fn jacobian(&self, state: &State<2>, receiver: &Pose) -> Matrix1x2<f64> {
            (state - receiver.position.xy()).normalize().transpose() * 1.0001
        }
    }

    fn hold_to_the_laws(model: &impl MeasurementModel<2, 1>, value: f64) {
        let pose = Pose::at(1.0, 2.0, 3.0);
        let noise = Matrix1::new(0.1);
        let z = Observation::new(0.0, pose, Vector1::new(value), noise).expect("proper");
        measurement_model(model, &Vector2::new(30.0, 40.0), &z);
    }

    #[test]
    #[should_panic(expected = "the jacobian is off by 0.0000999")]
    fn a_derivative_that_is_a_little_wrong_is_found() {
        hold_to_the_laws(&Steep, 50.0);
    }

    #[test]
    #[should_panic(expected = "jumps by 6.2")]
    fn an_angle_that_is_held_to_be_none_jumps() {
        hold_to_the_laws(&Linear, 0.1);
    }
}
