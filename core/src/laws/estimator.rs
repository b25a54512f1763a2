use nalgebra::SMatrix;

use crate::{Correction, Estimator, Observation};

/// An estimator's laws at one observation. `fresh` makes the same estimator each time.
///
/// # Panics
///
/// On a breach.
pub fn estimator<E: Estimator<N, M>, const N: usize, const M: usize>(
    fresh: impl Fn() -> E,
    observation: &Observation<M>,
) {
    nothing_heard_changes_nothing(&fresh, observation);
    for component in 0..M {
        missing_component_is_not_read(&fresh, observation, component);
    }
    let mut heard = fresh();
    if let Err(error) = heard.predict(1.0) {
        panic!("a step of one second was refused: {error}");
    }
    let predicted = heard.estimate();
    if heard.update(observation).is_err() {
        assert_eq!(heard.estimate(), predicted, "a refused observation changed the belief");
    } else {
        let p = heard.estimate().covariance;
        let skew: SMatrix<f64, N, N> = p - p.transpose();
        assert!(skew.norm() <= 1e-9 * p.norm(), "the covariance is not symmetric: {p}");
        assert!(p.cholesky().is_some(), "the covariance is not positive definite: {p}");
        samples_stand_for_the_belief(&heard);
    }
    for step in [-1.0, f64::NAN, f64::INFINITY] {
        let mut refused = fresh();
        assert!(refused.predict(step).is_err(), "a step of {step} s was taken");
        assert_eq!(refused.estimate(), fresh().estimate(), "a refused step changed the belief");
    }
}

fn nothing_heard_changes_nothing<E: Estimator<N, M>, const N: usize, const M: usize>(
    fresh: &impl Fn() -> E,
    observation: &Observation<M>,
) {
    let empty = (0..M).fold(*observation, Observation::without);
    let mut deaf = fresh();
    assert_eq!(deaf.update(&empty), Ok(Correction::Empty));
    assert_eq!(deaf.estimate(), fresh().estimate(), "an empty observation changed the belief");
}

fn missing_component_is_not_read<E: Estimator<N, M>, const N: usize, const M: usize>(
    fresh: &impl Fn() -> E,
    observation: &Observation<M>,
    component: usize,
) {
    let posterior = |shift: f64, present: bool, variance: f64| {
        let (mut value, mut noise) = (*observation.value(), observation.noise());
        value[component] += shift;
        noise.row_mut(component).fill(0.0);
        noise.column_mut(component).fill(0.0);
        noise[(component, component)] = variance;
        let whole = Observation::new(observation.time(), *observation.receiver(), value, noise)
            .expect("a shifted value is finite and the noise was decoupled");
        let mut estimator = fresh();
        let told = estimator.update(&if present { whole } else { whole.without(component) });
        (estimator.estimate(), matches!(told, Ok(Correction::Rejected { .. })))
    };
    let missing = posterior(0.0, false, 1.0);
    assert_eq!(missing, posterior(1.0, false, 1.0), "missing component {component} was read");

    // A gate's limit depends on how many components there are, so it may judge these two apart.
    let ((missing, out), (worthless, shut)) = (missing, posterior(0.0, true, 1e15));
    let before = fresh().estimate().covariance;
    let error = (missing.mean - worthless.mean).norm() / before.trace()
        + (missing.covariance - worthless.covariance).norm() / before.norm();
    assert!(
        out || shut || error < 1e-6,
        "missing component {component} still told something: {error}"
    );
}

fn samples_stand_for_the_belief<const N: usize, const M: usize>(estimator: &impl Estimator<N, M>) {
    let estimate = estimator.estimate();
    let (mut total, mut mean) = (0.0, estimate.mean * 0.0);
    estimator.visit_samples(&mut |x, w| {
        total += w;
        mean += (x - estimate.mean) * w;
    });
    assert!((total - 1.0).abs() < 1e-9, "the samples' weights sum to {total}");
    let error = mean.norm() / (1.0 + libm::sqrt(estimate.covariance.trace()));
    assert!(error < 1e-6, "the samples' mean is off by {error} of the belief's spread");
}
