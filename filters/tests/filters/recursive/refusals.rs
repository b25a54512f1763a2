use foxhunt_core::{
    Estimate, Estimator, EstimatorError, MeasurementModel, Observation, Pose, Quantity, RandomWalk,
    Role, State, nalgebra::Vector2, parameter::ParameterError,
};
use foxhunt_filters::{Ekf, ParticleFilter, Ukf};

use super::{
    edges::rng,
    model::{FIELD, observed},
};

/// A model that fails in the ways a model can.
struct Broken {
    expected: f64,
    log_likelihood: f64,
}

impl MeasurementModel<2, 2> for Broken {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::linear("east_m"), Quantity::linear("north_m")]
    }
    fn expected(&self, state: &State<2>, _receiver: &Pose) -> Vector2<f64> {
        state * self.expected
    }
    fn log_likelihood(&self, _state: &State<2>, _observation: &Observation<2>) -> f64 {
        self.log_likelihood
    }
}

#[test]
fn on_an_error_the_belief_is_left_as_it_was() {
    let prior = Estimate::isotropic(Vector2::new(1.0, 2.0), 3.0);
    let z = observed(Pose::default(), Vector2::zeros(), 1.0, 1.0);
    let still = RandomWalk::uniform(0.1);
    let not_finite = Err(EstimatorError::NotFinite { role: Role::Expected });
    for expected in [f64::NAN, f64::INFINITY] {
        let broken = || Broken { expected, log_likelihood: 0.0 };
        let mut ukf = Ukf::new(still, broken(), prior).expect("a proper prior");
        let mut ekf = Ekf::new(still, broken(), prior).expect("a proper prior");
        assert_eq!(ukf.update(&z), not_finite);
        assert_eq!(ekf.update(&z), not_finite);
        assert!(ukf.innovation(&z).is_err());
        assert_eq!((ukf.estimate(), ekf.estimate()), (prior, prior));
    }
    let filter = |log_likelihood| {
        let broken = Broken { expected: 1.0, log_likelihood };
        ParticleFilter::new(still, broken, prior, 50, rng(1)).expect("a proper prior")
    };
    let cloud = |filter: &dyn Estimator<2, 2>| {
        let mut cloud = Vec::new();
        filter.visit_samples(&mut |x, w| cloud.push((*x, w)));
        cloud
    };
    for (log, error) in [
        (f64::NEG_INFINITY, Err(EstimatorError::Impossible { particles: 50 })),
        (f64::NAN, not_finite),
        (f64::INFINITY, not_finite),
    ] {
        let mut hit = filter(log);
        let mut spared = filter(log);
        assert_eq!(hit.update(&z), error);
        assert_eq!(hit.predict(f64::NAN).map_err(|_| ()), Err(()));
        assert_eq!(hit.estimate(), spared.estimate());
        assert_eq!(cloud(&hit), cloud(&spared));
        // The generator stands where it stood, too.
        hit.predict(1.0).expect("a proper step");
        spared.predict(1.0).expect("a proper step");
        assert_eq!(cloud(&hit), cloud(&spared));
    }
    // The squares of a step of 10⁶ s overflow.
    let steep = RandomWalk::uniform(1e153);
    let lost = || ParticleFilter::new(steep, FIELD, prior, 50, rng(1)).expect("a proper prior");
    let mut hit = lost();
    let mut spared = lost();
    let posterior = Err(EstimatorError::NotFinite { role: Role::Posterior });
    assert_eq!(hit.predict(1e6), posterior);
    assert_eq!((cloud(&hit), hit.estimate()), (cloud(&spared), spared.estimate()));
    hit.predict(1e-300).expect("a step small enough");
    spared.predict(1e-300).expect("a step small enough");
    assert_eq!(cloud(&hit), cloud(&spared));
    let mut lost = Ukf::new(RandomWalk::uniform(f64::INFINITY), FIELD, prior).expect("proper");
    assert_eq!((lost.predict(1.0), lost.estimate()), (posterior, prior));
}

#[test]
fn improper_filters_are_refused() {
    let still = RandomWalk::uniform(0.1);
    let flat = Estimate::isotropic(Vector2::zeros(), 0.0);
    let indefinite = EstimatorError::NotPositiveDefinite { role: Role::Prior };
    assert_eq!(Ekf::new(still, FIELD, flat).err(), Some(indefinite));
    assert_eq!(ParticleFilter::new(still, FIELD, flat, 50, rng(1)).err(), Some(indefinite));
    let same = [Vector2::new(1.0, 1.0); 5];
    assert_eq!(ParticleFilter::from_samples(still, FIELD, &same, rng(1)).err(), Some(indefinite));
    let prior = Estimate::isotropic(Vector2::zeros(), 1.0);
    for few in 0..3 {
        let refused = ParticleFilter::new(still, FIELD, prior, few, rng(1)).err();
        assert!(matches!(
            refused,
            Some(EstimatorError::Parameter(ParameterError { name: "particles", .. }))
        ));
    }
    for out in [-0.1, 1.1, f64::NAN] {
        let filter = || ParticleFilter::new(still, FIELD, prior, 9, rng(1)).expect("proper");
        assert!(filter().with_resampling_threshold(out).is_err(), "{out}");
        assert!(filter().with_kernel_bandwidth(out).is_err(), "{out}");
    }
}
