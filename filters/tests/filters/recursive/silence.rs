//! That nothing was observed is information where the model has a likelihood for it.

use foxhunt_core::{
    Correction, Estimate, Estimator, MeasurementModel, Observation, Pose, Quantity, RandomWalk,
    State, gaussian_log_likelihood,
    nalgebra::{Matrix1, Vector1, Vector2},
};
use foxhunt_filters::{Ekf, ParticleFilter};

use super::edges::rng;

/// The distance from the receiver; a target that was not observed is farther away than the value.
struct Audible;

impl MeasurementModel<2, 1> for Audible {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::RSS]
    }
    fn expected(&self, target: &State<2>, receiver: &Pose) -> Vector1<f64> {
        Vector1::new(-(target - receiver.position.xy()).norm())
    }
    fn log_likelihood(&self, target: &State<2>, observation: &Observation<1>) -> f64 {
        let Some((limit, _)) = observation.upper_limit(0) else {
            return gaussian_log_likelihood(self, target, observation);
        };
        let observed = self.expected(target, observation.receiver())[0] > limit;
        if observed { f64::NEG_INFINITY } else { 0.0 }
    }
}

#[test]
fn a_cloud_moves_away_from_silence_and_a_kalman_filter_takes_it_for_nothing() {
    let prior = Estimate::isotropic(Vector2::zeros(), 10.0);
    let silence = Observation::new(0.0, Pose::default(), Vector1::new(-12.0), Matrix1::new(1.0));
    let silence = silence.expect("proper").below(0);
    let still = RandomWalk::uniform(0.1);
    let mut cloud = ParticleFilter::new(still, Audible, prior, 4000, rng(3)).expect("proper");
    let Ok(Correction::Fused { nis, log_evidence, .. }) = cloud.update(&silence) else {
        panic!("silence was not fused")
    };
    // P(|x| > 12) of an isotropic Gaussian of 10 is e^−0.72; 4000 particles, 3.3 standard errors.
    assert!((log_evidence + 0.72).abs() < 3.3 * ((1.0 / 0.487 - 1.0) / 4000.0_f64).sqrt());
    assert_eq!(nis, None, "there is no innovation");
    cloud.visit_samples(&mut |x, w| assert!(x.norm() > 12.0 || w < 1e-300));

    let mut ekf = Ekf::new(still, Audible, prior).expect("proper");
    assert_eq!(ekf.update(&silence), Ok(Correction::Empty));
    assert_eq!(ekf.estimate(), prior);
}
