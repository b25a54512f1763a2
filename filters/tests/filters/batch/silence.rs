//! Missing observations, in a batch.

use foxhunt_core::{
    Correction, Estimate, Estimator, MeasurementModel, Observation, Pose, Quantity, RandomWalk,
    State, gaussian_log_likelihood,
};
use foxhunt_filters::{BatchEstimator, BatchSolver};
use nalgebra::{Matrix1, Vector1, Vector2};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

fn standard() -> Normal {
    Normal::new(0.0, 1.0).expect("proper")
}

/// z = East; silence has the probability that it lies below the limit.
struct East;

impl MeasurementModel<2, 1> for East {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::linear("x_m")]
    }
    fn expected(&self, state: &State<2>, _receiver: &Pose) -> Vector1<f64> {
        Vector1::new(state[0])
    }
    fn log_likelihood(&self, state: &State<2>, observation: &Observation<1>) -> f64 {
        let Some((limit, sigma)) = observation.upper_limit(0) else {
            return gaussian_log_likelihood(self, state, observation);
        };
        standard().cdf((limit - state[0]) / sigma).ln()
    }
}

fn observation(z: f64) -> Observation<1> {
    Observation::new(0.0, Pose::default(), Vector1::new(z), Matrix1::new(1.0)).expect("proper")
}

/// A prior N(0, 4), a level of 0.5 and one that lay below −1, both of σ 1: the mode by bisection.
#[test]
fn silence_moves_the_optimum() {
    let prior = Estimate::isotropic(Vector2::zeros(), 2.0);
    let observed = observation(0.5);
    let silent = observation(-1.0).below(0);
    let ratio = |x: f64| standard().pdf(-1.0 - x) / standard().cdf(-1.0 - x);
    let slope = |x: f64| x / 4.0 + (x - 0.5) + ratio(x);
    let mut low = -5.0;
    let mut high = 5.0;
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if slope(middle) > 0.0 { high = middle } else { low = middle }
    }
    let curvature = 1.25 + ratio(low) * (ratio(low) - 1.0 - low);
    let solver = BatchSolver::new(East).with_prior(prior).expect("proper");
    let fix = solver.solve(&[observed, silent], &[]).expect("an optimum").estimate;
    assert!((fix.mean[0] - low).abs() < 1e-6, "{fix:?}, not {low}");
    assert!((fix.covariance[(0, 0)] - 1.0 / curvature).abs() < 1e-4, "{fix:?}");
    assert!(fix.mean[1].abs() < 1e-6 && (fix.covariance[(1, 1)] - 4.0).abs() < 1e-6);

    let still = RandomWalk::uniform(0.0);
    let mut estimator = BatchEstimator::new(still, East, prior).expect("proper");
    let reported = estimator.update(&silent);
    let Ok(Correction::Fused { nis: None, log_evidence, .. }) = reported else {
        panic!("{reported:?}")
    };
    // P(z < −1) of N(0, 1 + 4), which Laplace comes near to.
    let exact = standard().cdf(-1.0 / 5.0_f64.sqrt()).ln();
    assert!((log_evidence - exact).abs() < 0.05, "{log_evidence}, not {exact}");
    let _ = estimator.update(&observed).expect("possible");
    assert!((estimator.estimate().mean - fix.mean).norm() < 1e-6);
}
