//! Observations that arrive late, and what was believed at a lag.

use approx::assert_abs_diff_eq;
use foxhunt_core::{
    ConstantVelocity, Correction, Estimate, Estimator, EstimatorError, MeasurementModel,
    MotionModel, Observation, Pose, Quantity, RandomWalk, State, laws,
    nalgebra::{DMatrix, DVector, Matrix2, Vector2, Vector4},
};
use foxhunt_filters::{Ckf, Ekf, Gate, OutOfOrder, ParticleFilter, Ukf, rauch_tung_striebel};
use proptest::prelude::*;
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::{
    edges::rng,
    model::{FIELD, RssBearing, observed},
};

const WALK: f64 = 0.3;

fn prior() -> Estimate<2> {
    Estimate::isotropic(Vector2::new(20.0, 5.0), 6.0)
}

/// Ten observations, 1.3 s apart but for two at one time, from seed 7.
fn flight() -> Vec<Observation<2>> {
    let mut rng = rng(7);
    let at = |i: u32| 1.3 * f64::from(if i == 5 { 4 } else { i }) + 0.4;
    (0..10)
        .map(|i| {
            let receiver = Pose::at(4.0 * f64::from(i), -10.0, 4.0);
            let mut white = || -> f64 { rng.sample(StandardNormal) };
            let noise = Vector2::new(4.0 * white(), 0.2 * white());
            let z = FIELD.expected(&Vector2::new(24.0, 3.0), &receiver) + noise;
            let r = Matrix2::from_diagonal(&Vector2::new(16.0, 0.04));
            let whole = Observation::new(at(i), receiver, z, r).expect("proper");
            if i % 4 == 2 { whole.without(1) } else { whole }
        })
        .collect()
}

fn reported<E: Estimator<2, 2> + Clone>(
    estimator: E,
    arrivals: impl IntoIterator<Item = Observation<2>>,
) -> Estimate<2> {
    let mut estimator = OutOfOrder::new(estimator, 0.0, 60.0).expect("a proper lag");
    for observation in arrivals {
        let _ = estimator.update(&observation).expect("not too late");
    }
    estimator.estimate()
}

fn ekf() -> Ekf<RandomWalk<2>, RssBearing, 2, 2> {
    Ekf::new(RandomWalk::uniform(WALK), FIELD, prior()).expect("proper")
}

fn cloud() -> ParticleFilter<RandomWalk<2>, RssBearing, Xoshiro256PlusPlus, 2, 2> {
    ParticleFilter::new(RandomWalk::uniform(WALK), FIELD, prior(), 200, rng(1)).expect("proper")
}

proptest! {
    #[test]
    fn any_order_of_arrival_is_the_same_to_the_bit(
        order in Just((0..10).collect::<Vec<usize>>()).prop_shuffle(),
    ) {
        let flight = flight();
        let shuffled = || order.iter().map(|i| flight[*i]);
        let gate = Gate::probability(0.9).expect("in range").with_most_rejections(2);
        let gated = || ekf().with_gate(gate);
        prop_assert_eq!(reported(gated(), shuffled()), reported(gated(), flight.clone()));
        let ukf = || Ukf::new(RandomWalk::uniform(WALK), FIELD, prior()).expect("proper");
        prop_assert_eq!(reported(ukf(), shuffled()), reported(ukf(), flight.clone()));
        let ckf = || Ckf::new(RandomWalk::uniform(WALK), FIELD, prior()).expect("proper");
        prop_assert_eq!(reported(ckf(), shuffled()), reported(ckf(), flight.clone()));
        prop_assert_eq!(reported(cloud(), shuffled()), reported(cloud(), flight.clone()));
    }
}

#[test]
fn in_order_it_is_the_estimator_itself() {
    let mut bare = ekf();
    let mut time = 0.0;
    let mut wrapped = OutOfOrder::new(ekf(), 0.0, 2.0).expect("a proper lag");
    for observation in flight() {
        bare.predict(observation.time() - time).expect("a proper step");
        time = observation.time();
        let reported = bare.update(&observation);
        assert_eq!(reported, wrapped.update(&observation));
        assert_eq!(bare.estimate(), wrapped.estimate());
    }
    // Time that passes, and an observation of an earlier time after it.
    bare.predict(3.0).expect("a proper step");
    wrapped.predict(3.0).expect("a proper step");
    assert_eq!(bare.estimate(), wrapped.estimate());
    assert_abs_diff_eq!(wrapped.time() - time, 3.0, epsilon = 1e-12);
    assert_eq!(wrapped.estimator().estimate(), wrapped.estimate());
}

#[test]
fn without_a_start_the_first_of_them_is_it() {
    let flight = flight();
    let mut bare = ekf();
    let mut time = flight[0].time();
    for observation in &flight {
        bare.predict(observation.time() - time).expect("a proper step");
        time = observation.time();
        let _ = bare.update(observation).expect("proper");
    }
    // The first comes last.
    let mut wrapped = OutOfOrder::from_first(ekf(), 60.0).expect("a proper lag");
    for observation in flight.iter().rev() {
        let _ = wrapped.update(observation).expect("not too late");
    }
    assert_eq!(wrapped.estimate(), bare.estimate());
    let smoothed = wrapped.smoothed(&RandomWalk::uniform(WALK)).expect("definite");
    assert_eq!(smoothed.len(), flight.len());
    // With a lag, the horizon is that of the oldest that is settled.
    let mut short = OutOfOrder::from_first(ekf(), 3.0).expect("a proper lag");
    for observation in &flight {
        let _ = short.update(observation).expect("in order");
    }
    assert!(short.horizon() > 0.0 && short.update(&flight[0]).is_err());
    assert!(OutOfOrder::from_first(ekf(), f64::INFINITY).is_err());
}

#[test]
fn what_comes_too_late_is_refused_and_leaves_all_as_it_was() {
    let flight = flight();
    let mut estimator = OutOfOrder::new(ekf(), 0.0, 3.0).expect("a proper lag");
    for observation in flight.iter().skip(1) {
        let _ = estimator.update(observation).expect("in order");
    }
    let before = estimator.estimate();
    let horizon = estimator.horizon();
    // The newest is of 12.1 s: what is before 9.1 s is settled, the last of it of 8.2 s.
    assert_abs_diff_eq!(horizon, 8.2, epsilon = 1e-9);
    let time = flight[0].time();
    assert_eq!(estimator.update(&flight[0]), Err(EstimatorError::TooLate { time, horizon }));
    assert_eq!(estimator.estimate(), before);
    // A count bounds it too.
    let mut few = OutOfOrder::new(ekf(), 0.0, 60.0).and_then(|e| e.with_most(2)).expect("proper");
    for observation in flight.iter().skip(1) {
        let _ = few.update(observation).expect("in order");
    }
    assert_eq!(few.estimate(), before);
    assert_abs_diff_eq!(few.horizon(), flight[7].time(), epsilon = 1e-12);
    assert!(few.update(&flight[2]).is_err());
    assert!(OutOfOrder::new(ekf(), 0.0, -1.0).is_err());
    assert!(OutOfOrder::new(ekf(), f64::NAN, 1.0).is_err());
    assert!(few.with_most(0).is_err());
}

/// Refuses levels above −20 dBm, whenever they come.
#[derive(Clone)]
struct Picky<E>(E);

impl<E: Estimator<2, 2>> Estimator<2, 2> for Picky<E> {
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        self.0.predict(dt)
    }
    fn quantities(&self) -> [Quantity; 2] {
        self.0.quantities()
    }

    fn update(&mut self, observation: &Observation<2>) -> Result<Correction, EstimatorError> {
        if observation.value()[0] > -20.0 {
            return Err(EstimatorError::Impossible { particles: 1 });
        }
        self.0.update(observation)
    }
    fn estimate(&self) -> Estimate<2> {
        self.0.estimate()
    }
}

#[test]
fn what_the_estimator_refuses_leaves_no_trace() {
    let mut flight = flight();
    let loud =
        Observation::new(5.0, Pose::default(), Vector2::new(-10.0, 0.0), Matrix2::identity());
    let clean = reported(Picky(ekf()), flight.clone());
    flight.insert(3, loud.expect("proper"));
    let mut estimator = OutOfOrder::new(Picky(ekf()), 0.0, 60.0).expect("a proper lag");
    for (i, observation) in flight.iter().rev().enumerate() {
        assert_eq!(estimator.update(observation).is_err(), i == 7, "{i}");
    }
    assert_eq!(estimator.estimate(), clean);
}

#[test]
fn a_late_observation_does_not_turn_the_clock_back() {
    let flight = flight();
    let late = &flight[2];
    let mut estimator = OutOfOrder::new(ekf(), 0.0, 60.0).expect("a proper lag");
    estimator.predict(10.0).expect("a proper step");
    let _ = estimator.update(late).expect("not too late");
    let mut plain = ekf();
    plain.predict(late.time()).expect("a proper step");
    let _ = plain.update(late).expect("possible");
    plain.predict(10.0 - late.time()).expect("a proper step");
    assert_eq!(estimator.estimate(), plain.estimate(), "the belief is that of 10 s");
    estimator.predict(1.0).expect("a proper step");
    let before = estimator.estimate();
    // An observation of 10.5 s is older than the clock by half a second.
    let mut after = late.without(0).without(1);
    assert_eq!(estimator.update(&after), Ok(Correction::Empty));
    assert_eq!(estimator.estimate(), before);
    after = Observation::new(10.5, *late.receiver(), *late.value(), Matrix2::identity() * 1e12)
        .expect("proper");
    let _ = estimator.update(&after).expect("in order");
    let apart = (estimator.estimate().covariance - before.covariance).norm();
    assert!(apart < 1e-6 * before.covariance.norm(), "the clock stands at 11 s: {apart}");
}

#[test]
fn it_keeps_the_laws() {
    let observation = observed(Pose::at(1.0, 2.0, 4.0), Vector2::new(-65.0, 0.4), 4.0, 0.3);
    laws::estimator(|| OutOfOrder::new(ekf(), 0.0, 5.0).expect("proper"), &observation);
    laws::estimator(|| OutOfOrder::new(cloud(), 0.0, 5.0).expect("proper"), &observation);
    laws::estimator(|| OutOfOrder::from_first(ekf(), 5.0).expect("proper"), &observation);
}

/// The position of a moving target.
#[derive(Clone)]
struct Place;

impl MeasurementModel<4, 2> for Place {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::linear("east_m"), Quantity::linear("north_m")]
    }
    fn expected(&self, state: &State<4>, _receiver: &Pose) -> Vector2<f64> {
        state.fixed_rows::<2>(0).into_owned()
    }
}

#[test]
fn smoothing_is_the_joint_posterior_of_all_states() {
    const STEPS: usize = 6;
    let motion = ConstantVelocity { spectral_density: 0.16 };
    let prior = Estimate::isotropic(Vector4::new(1.0, -2.0, 0.5, 0.1), 3.0);
    let filter = Ekf::new(motion, Place, prior).expect("a proper prior");
    let mut estimator = OutOfOrder::new(filter, 0.0, 60.0).expect("a proper lag");
    let r = Matrix2::new(0.8, 0.2, 0.2, 0.5);
    let times = [0.0, 0.7, 1.1, 2.0, 2.0, 3.5];
    // All states at the six times at once: the information of prior, motion and observations.
    let mut information = DMatrix::<f64>::zeros(4 * STEPS, 4 * STEPS);
    let mut right = DVector::<f64>::zeros(4 * STEPS);
    let inverse = r.try_inverse().expect("regular");
    let first = foxhunt_core::Covariance::<4>::identity() / 9.0;
    information.view_mut((0, 0), (4, 4)).copy_from(&first);
    right.rows_mut(0, 4).copy_from(&(first * prior.mean));
    for (k, time) in times.iter().enumerate() {
        let z = Vector2::new(1.0 + 0.8 * time, -2.0 + [0.0, 0.7, 1.4][k % 3]);
        let observation = Observation::new(*time, Pose::default(), z, r).expect("proper");
        let _ = estimator.update(&observation).expect("in order");
        let mut block = information.view_mut((4 * k, 4 * k), (2, 2));
        block += inverse;
        let mut rows = right.rows_mut(4 * k, 2);
        rows += inverse * z;
        if k > 0 {
            // Two at one time are one state, but for a millionth.
            let dt = (time - times[k - 1]).max(1e-9);
            let f = motion.jacobian(&prior.mean, dt);
            let l = motion.noise_factor(&prior.mean, dt);
            let floor = foxhunt_core::Covariance::<4>::identity() * 1e-9;
            let q = (l * l.transpose() + floor).try_inverse().expect("regular");
            let mut step = DMatrix::zeros(8, 8);
            step.view_mut((0, 0), (4, 4)).copy_from(&(f.transpose() * q * f));
            step.view_mut((0, 4), (4, 4)).copy_from(&-(f.transpose() * q));
            step.view_mut((4, 0), (4, 4)).copy_from(&-(q * f));
            step.view_mut((4, 4), (4, 4)).copy_from(&q);
            let mut block = information.view_mut((4 * (k - 1), 4 * (k - 1)), (8, 8));
            block += step;
        }
    }
    let covariance = information.try_inverse().expect("definite");
    let mean = &covariance * right;
    let smoothed = estimator.smoothed(&motion).expect("definite");
    assert_eq!(smoothed.len(), STEPS + 1, "one before the first observation");
    for (k, (time, belief)) in smoothed[1..].iter().enumerate() {
        assert_abs_diff_eq!(*time, times[k], epsilon = 1e-15);
        let exact = mean.rows(4 * k, 4);
        let error = (0..4).map(|i| (belief.mean[i] - exact[i]).abs()).fold(0.0, f64::max);
        assert!(error < 1e-4, "{k}: mean off by {error}");
        let exact = covariance.view((4 * k, 4 * k), (4, 4));
        let error = (belief.covariance - exact).amax();
        assert!(error < 1e-4, "{k}: covariance off by {error}");
    }
    // The last is the filter's own, and each is narrower than what was believed at its time.
    assert_eq!(smoothed[STEPS].1, estimator.estimate());
    let descending = [(1.0, prior), (0.5, prior)];
    assert_eq!(
        rauch_tung_striebel(&motion, &descending),
        Err(EstimatorError::TimeStep { dt: -0.5 })
    );
}
