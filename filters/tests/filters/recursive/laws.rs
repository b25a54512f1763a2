//! Laws that every filter keeps, refusals, and the information in an observation that was not made.

use approx::assert_abs_diff_eq;
use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, MeasurementModel, Observation, OutlierMixture,
    Pose, Quantity, RandomWalk, Role, State, gaussian_log_likelihood,
    laws::{self, Checks},
    nalgebra::{Matrix1, Matrix2, Vector1, Vector2},
    parameter::ParameterError,
};
use foxhunt_filters::{
    Ckf, Ekf, Gate, GaussianSum, GridConfig, GridFilter, Iterations, KldSampling, ParticleFilter,
    Resampling, Ukf, Unscented, split,
};
use proptest::prelude::*;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use super::{
    edges::rng,
    model::{FIELD, observed},
};

const STILL: f64 = 0.1957;

/// The laws at one observation: these problems are as coarse as they come.
const AT_ONE: Checks = Checks::AT_ONE_OBSERVATION;

/// [`FIELD`] with outliers.
#[derive(Clone, Copy)]
struct Doubtful;

impl MeasurementModel<2, 2> for Doubtful {
    fn quantities(&self) -> [Quantity; 2] {
        FIELD.quantities()
    }

    fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector2<f64> {
        FIELD.expected(state, receiver)
    }

    fn log_likelihood(&self, state: &State<2>, observation: &Observation<2>) -> f64 {
        outliers().log_density(FIELD.log_likelihood(state, observation), observation)
    }
}

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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_estimator_over_outliers_keeps_the_laws((prior, observed) in problem()) {
        let checks = Checks { worthless_tolerance: None, ..AT_ONE };
        let still = RandomWalk::uniform(STILL);
        let ekf = Ekf::new(still, FIELD, prior).expect("a proper prior");
        laws::estimator_with(|| ekf.clone().with_outliers(outliers()), &observed, checks);
        let ckf = Ckf::new(still, FIELD, prior).expect("a proper prior");
        laws::estimator_with(|| ckf.clone().with_outliers(outliers()), &observed, checks);
        let parts = split(&prior, [3, 2]).expect("a proper prior");
        let sum = || GaussianSum::new(&ekf, parts.clone()).expect("proper");
        laws::estimator_with(|| sum().with_outliers(outliers()), &observed, checks);
        let cloud = || {
            let rng = Xoshiro256PlusPlus::seed_from_u64(1);
            ParticleFilter::new(still, Doubtful, prior, 300, rng).expect("a proper prior")
        };
        laws::estimator_with(cloud, &observed, checks);
        let config = GridConfig { side: 32, ..GridConfig::default() };
        let grid = || GridFilter::new(still, Doubtful, prior, config.clone()).expect("proper");
        laws::estimator_with(grid, &observed, checks);
        // Levels spread evenly without an end are no density; bearings all round are.
        laws::measurement_model_at_one_observation(&Doubtful, &prior.mean, &observed);
        laws::measurement_model(&Doubtful, &prior.mean, &observed.without(0));
    }
}

proptest! {
    #[test]
    fn every_estimator_keeps_the_laws((prior, observed) in problem()) {
        let still = RandomWalk::uniform(STILL);

        let ekf = || Ekf::new(still, FIELD, prior).expect("a proper prior");
        laws::estimator_with(ekf, &observed, AT_ONE);
        let gate = Gate::probability(0.99).expect("in range");
        laws::estimator_with(|| ekf().with_gate(gate), &observed, AT_ONE);
        let ukf = || Ukf::new(still, FIELD, prior).expect("a proper prior");
        laws::estimator_with(ukf, &observed, AT_ONE);
        let thin = Unscented::new(0.01, 2.0, 0.0).expect("in range");
        let ukf = || Ukf::new(still, FIELD, prior).and_then(|ukf| ukf.with_transform(thin));
        laws::estimator_with(|| ukf().expect("a proper prior"), &observed, AT_ONE);
        let ckf = || Ckf::new(still, FIELD, prior).expect("a proper prior");
        laws::estimator_with(ckf, &observed, AT_ONE);
        let five = Iterations::at_most(5).expect("at least one");
        laws::estimator_with(|| ckf().with_iterations(five), &observed, AT_ONE);
        laws::estimator_with(|| ekf().with_iterations(five), &observed, AT_ONE);
        let ukf = || Ukf::pritzl2018(FIELD, prior).expect("a proper prior");
        laws::estimator_with(ukf, &observed, AT_ONE);
        let ekf = || Ekf::pritzl2018(FIELD, prior).expect("a proper prior");
        laws::estimator_with(ekf, &observed, AT_ONE);
        laws::estimator_with(|| particles(prior, Resampling::Systematic, 0.3), &observed, AT_ONE);
        laws::estimator_with(|| particles(prior, Resampling::Multinomial, 0.0), &observed, AT_ONE);
        laws::estimator_with(|| particles(prior, Resampling::Stratified, 0.2), &observed, AT_ONE);
        laws::estimator_with(|| particles(prior, Resampling::Residual, 0.2), &observed, AT_ONE);
        laws::estimator_with(|| adaptive(prior), &observed, AT_ONE);
        let boxed = || -> Box<dyn Estimator<2, 2>> {
            Box::new(particles(prior, Resampling::Systematic, 0.1))
        };
        laws::estimator_with(boxed, &observed, AT_ONE);
    }
}

fn particles(prior: Estimate<2>, scheme: Resampling, bandwidth: f64) -> impl Estimator<2, 2> {
    let rng = Xoshiro256PlusPlus::seed_from_u64(1);
    ParticleFilter::new(RandomWalk::uniform(STILL), FIELD, prior, 300, rng)
        .and_then(|filter| filter.with_kernel_bandwidth(bandwidth))
        .expect("a proper prior")
        .with_resampling(scheme)
}

fn adaptive(prior: Estimate<2>) -> impl Estimator<2, 2> {
    let rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let size = KldSampling::new(Vector2::repeat(5.0), 200, 400).expect("in range");
    ParticleFilter::new(RandomWalk::uniform(STILL), FIELD, prior, 300, rng)
        .and_then(|filter| filter.with_progressive_correction(0.5))
        .and_then(|filter| filter.with_resampling_threshold(1.0))
        .expect("a proper prior")
        .with_adaptive_size(size)
}

/// A prior anywhere and what a drone near by may observe.
pub(super) fn problem() -> impl Strategy<Value = (Estimate<2>, Observation<2>)> {
    let prior = (-200.0..200.0, -200.0..200.0, 1.0..50.0, -0.9..0.9).prop_map(
        |(east, north, sigma, tilt): (f64, f64, f64, f64)| {
            let covariance = Matrix2::new(1.0, tilt, tilt, 1.0) * (sigma * sigma);
            Estimate { mean: Vector2::new(east, north), covariance }
        },
    );
    let observation = (0.0..60.0, -110.0..-20.0, -4.0..4.0, 0.5..20.0, 0.02..2.0).prop_map(
        |(up, rss, bearing, sigma_rss, sigma_bearing)| {
            let receiver = Pose::at(12.0, -5.0, up);
            observed(receiver, Vector2::new(rss, bearing), sigma_rss, sigma_bearing)
        },
    );
    (prior, observation)
}

/// A level of any value within 100 dB and a bearing from anywhere, one in five.
fn outliers() -> OutlierMixture<2> {
    OutlierMixture::new(0.2, [100.0, core::f64::consts::TAU]).expect("in range")
}

#[test]
#[should_panic(expected = "Kalman<foxhunt_filters::transform::Taylor")]
fn a_breach_names_the_estimator() {
    let prior = Estimate::isotropic(Vector2::new(6.0, -3.0), 2.0);
    let observed = observed(Pose::at(40.0, 0.0, 4.0), Vector2::new(-60.0, 1.0), 4.0, 0.1);
    // By the default checks a model of outliers is in breach.
    let ekf = Ekf::new(RandomWalk::uniform(STILL), FIELD, prior).expect("a proper prior");
    laws::estimator_with(|| ekf.clone().with_outliers(outliers()), &observed, AT_ONE);
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
        // Nothing was drawn for it, too.
        hit.predict(1.0).expect("a proper step");
        spared.predict(1.0).expect("a proper step");
        assert_eq!(cloud(&hit), cloud(&spared));
    }
    // The squares of a step of 10⁶ s overflow.
    let steep = RandomWalk::uniform(1e153);
    let lost = || ParticleFilter::new(steep, FIELD, prior, 50, rng(1)).expect("a proper prior");
    let mut hit = lost();
    let spared = lost();
    let posterior = Err(EstimatorError::NotFinite { role: Role::Posterior });
    assert_eq!(hit.predict(1e6), posterior);
    assert_eq!((cloud(&hit), hit.estimate()), (cloud(&spared), spared.estimate()));
    hit.predict(1e-300).expect("a step small enough");
    let mut lost = Ukf::new(RandomWalk::uniform(f64::INFINITY), FIELD, prior).expect("proper");
    let noise = Err(EstimatorError::NotFinite { role: Role::ProcessNoise });
    assert_eq!((lost.predict(1.0), lost.estimate()), (noise, prior));
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
    assert_abs_diff_eq!(
        log_evidence,
        -0.72,
        epsilon = 3.3 * ((1.0 / 0.487 - 1.0) / 4000.0_f64).sqrt()
    );
    assert_eq!(nis, None, "there is no innovation");
    cloud.visit_samples(&mut |x, w| assert!(x.norm() > 12.0 || w < 1e-300));

    let mut ekf = Ekf::new(still, Audible, prior).expect("proper");
    assert_eq!(ekf.update(&silence), Ok(Correction::Empty));
    assert_eq!(ekf.estimate(), prior);
}
