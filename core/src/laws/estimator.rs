use core::any::type_name;

use nalgebra::SMatrix;

use crate::{Correction, Estimator, Observation};

/// Laws that [`estimator_with`] checks on an estimator, and their tolerances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checks {
    /// The length of the predicted step, in seconds.
    pub step: f64,
    /// Largest distance, as a share of the belief's spread, of the posterior with a component of a
    /// variance of 10¹⁵ from that without the component. `None` leaves this law out: a model of
    /// outliers takes such an observation for one, so that it differs from a missing component.
    pub worthless_tolerance: Option<f64>,
}

/// A step of 1 s; a worthless component is a missing one, to 10⁻⁶.
impl Default for Checks {
    fn default() -> Self {
        Self { step: 1.0, worthless_tolerance: Some(1e-6) }
    }
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
    let name = type_name::<E>();
    empty_observation_changes_nothing(&fresh, observation);
    for component in 0..M {
        missing_component_is_not_read(&fresh, observation, component, checks);
    }
    let mut updated = fresh();
    if let Err(error) = updated.predict(checks.step) {
        panic!("{name}: a step of {} s was refused: {error}", checks.step);
    }
    let predicted = updated.estimate();
    if updated.update(observation).is_err() {
        let left = updated.estimate() == predicted;
        assert!(left, "{name}: a refused observation changed the belief");
    } else {
        let p = updated.estimate().covariance;
        let skew: SMatrix<f64, N, N> = p - p.transpose();
        assert!(skew.norm() <= 1e-9 * p.norm(), "{name}: the covariance is not symmetric: {p}");
        let definite = p.cholesky().is_some();
        assert!(definite, "{name}: the covariance is not positive definite: {p}");
        samples_represent_the_belief(&updated);
    }
    for step in [-1.0, f64::NAN, f64::INFINITY] {
        let mut refused = fresh();
        assert!(refused.predict(step).is_err(), "{name}: a step of {step} s was accepted");
        let left = refused.estimate() == fresh().estimate();
        assert!(left, "{name}: a refused step of {step} s changed the belief");
    }
}

fn empty_observation_changes_nothing<E: Estimator<N, M>, const N: usize, const M: usize>(
    fresh: &impl Fn() -> E,
    observation: &Observation<M>,
) {
    let name = type_name::<E>();
    let empty = (0..M).fold(*observation, Observation::without);
    let mut idle = fresh();
    let correction = idle.update(&empty);
    assert_eq!(correction, Ok(Correction::Empty), "{name}: an observation without components");
    let left = idle.estimate() == fresh().estimate();
    assert!(left, "{name}: an empty observation changed the belief");
}

fn missing_component_is_not_read<E: Estimator<N, M>, const N: usize, const M: usize>(
    fresh: &impl Fn() -> E,
    observation: &Observation<M>,
    component: usize,
    checks: Checks,
) {
    let name = type_name::<E>();
    let posterior = |shift: f64, present: bool, variance: f64| {
        let mut value = *observation.value();
        let mut noise = observation.noise();
        value[component] += shift;
        noise.row_mut(component).fill(0.0);
        noise.column_mut(component).fill(0.0);
        noise[(component, component)] = variance;
        let whole = Observation::new(observation.time(), *observation.receiver(), value, noise)
            .expect("a shifted value is finite and the noise was decoupled");
        let mut estimator = fresh();
        let correction = estimator.update(&if present { whole } else { whole.without(component) });
        (estimator.estimate(), matches!(correction, Ok(Correction::Rejected { .. })))
    };
    let (missing, rejected) = posterior(0.0, false, 1.0);
    let unread = (missing, rejected) == posterior(1.0, false, 1.0);
    assert!(unread, "{name}: missing component {component} was read");

    let Some(tolerance) = checks.worthless_tolerance else { return };
    // A gate's limit depends on how many components there are, so it may judge these two apart.
    let (worthless, worthless_rejected) = posterior(0.0, true, 1e15);
    let before = fresh().estimate().covariance;
    let error = (missing.mean - worthless.mean).norm() / before.trace()
        + (missing.covariance - worthless.covariance).norm() / before.norm();
    assert!(
        rejected || worthless_rejected || error < tolerance,
        "{name}: missing component {component} still has an effect: {error}"
    );
}

fn samples_represent_the_belief<E: Estimator<N, M>, const N: usize, const M: usize>(estimator: &E) {
    let name = type_name::<E>();
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
