//! Improper inputs are named.

use foxhunt_core::{
    Estimate, Estimator, EstimatorError, MeasurementModel, Pose, Quantity, RandomWalk, Role, State,
    parameter::ParameterError,
};
use foxhunt_filters::{BatchError, BatchEstimator, BatchSolver, Loss};
use nalgebra::Vector2;

use super::model::{MODEL, observed};

/// Finite only near the origin.
struct Broken;

impl MeasurementModel<2, 2> for Broken {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::linear("east_m"), Quantity::linear("north_m")]
    }
    fn expected(&self, state: &State<2>, _receiver: &Pose) -> Vector2<f64> {
        if state.norm() < 5.0 { *state } else { state * f64::NAN }
    }
}

#[test]
fn improper_settings_are_refused() {
    let solver = || BatchSolver::<_, 2>::new(MODEL);
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(solver().with_reach(value), Err(BatchError::Parameter(_))));
        let loss = solver().with_loss(Loss::Huber { k: value });
        assert!(matches!(loss, Err(BatchError::Parameter(ParameterError { name: "k", .. }))));
    }
    let flat = Estimate::isotropic(Vector2::zeros(), 0.0);
    let improper = BatchError::Improper { what: "prior" };
    assert_eq!(solver().with_prior(flat).err(), Some(improper));
    let z = observed(Pose::at(0.0, 0.0, 5.0), Vector2::new(-50.0, 0.3), Vector2::new(1.0, 0.1));
    assert!(matches!(solver().solve::<2>(&[], &[]), Err(BatchError::TooFew { have: 0, .. })));
    let no_start = solver().solve(&[z], &[]);
    assert_eq!(no_start, Err(BatchError::TooFew { what: "starts", have: 0, need: 1 }));
    let one = solver().solve(&[z.without(0)], &[Vector2::new(1.0, 1.0)]);
    assert!(matches!(one, Err(BatchError::TooFew { have: 1, need: 2, .. })));
    let far = Vector2::new(10.0, 0.0);
    let broken = BatchSolver::new(Broken).solve(&[z], &[far]);
    assert_eq!(broken, Err(BatchError::Improper { what: "model" }));
    let near = BatchSolver::new(Broken).solve(&[z, z], &[far, Vector2::zeros()]);
    assert!(near.is_err(), "the optimum is where the model is not finite: {near:?}");
}

#[test]
fn on_an_error_the_belief_is_left_as_it_was() {
    let prior = Estimate::isotropic(Vector2::new(50.0, 0.0), 3.0);
    let mut estimator =
        BatchEstimator::new(RandomWalk::uniform(0.1), Broken, prior).expect("a proper prior");
    let z = observed(Pose::default(), Vector2::zeros(), Vector2::new(1.0, 1.0));
    assert_eq!(estimator.update(&z), Err(EstimatorError::NotFinite { role: Role::Expected }));
    assert_eq!((estimator.estimate(), estimator.observations().len()), (prior, 0));
    // Finite at the prior's mean, but not where the optimum would be.
    let prior = Estimate::isotropic(Vector2::new(2.0, 0.0), 3.0);
    let mut estimator =
        BatchEstimator::new(RandomWalk::uniform(0.1), Broken, prior).expect("a proper prior");
    let near = observed(Pose::default(), Vector2::new(1.0, 1.0), Vector2::new(1.0, 1.0));
    let _ = estimator.update(&near).expect("possible");
    let before = estimator.estimate();
    let far = observed(Pose::default(), Vector2::new(60.0, 0.0), Vector2::new(0.1, 0.1));
    assert!(estimator.update(&far).is_err());
    assert_eq!((estimator.estimate(), estimator.observations().len()), (before, 1));
    let _ = estimator.update(&near).expect("possible");
    assert!(estimator.estimate().covariance.trace() < before.covariance.trace());
    for drift in [-1.0, f64::NAN] {
        let refused = BatchEstimator::new(RandomWalk::uniform(drift), MODEL, prior).err();
        assert!(matches!(
            refused,
            Some(EstimatorError::Parameter(ParameterError { name: "drift", .. }))
        ));
    }
    let flat = Estimate::isotropic(Vector2::zeros(), 0.0);
    let refused = BatchEstimator::new(RandomWalk::uniform(0.1), MODEL, flat).err();
    assert_eq!(refused, Some(EstimatorError::NotPositiveDefinite { role: Role::Prior }));
    let estimator = BatchEstimator::new(RandomWalk::uniform(0.1), MODEL, prior).expect("proper");
    assert!(estimator.with_loss(Loss::Cauchy { c: 0.0 }).is_err());
}
