//! Laws over all observations that may come: every estimator keeps them, and for each of them there
//! is a mistake that nothing else finds.

use core::f64::consts::TAU;
use std::panic::{AssertUnwindSafe, catch_unwind};

use foxhunt_core::{
    ConstantVelocity, Correction, Estimate, Estimator, EstimatorError, MeasurementModel,
    MotionModel, Observation, Pose, Quantity, RandomWalk, State,
    laws::{self, Checks, Predictive},
    nalgebra::{Matrix2, Matrix4, SMatrix, SVector, Vector1, Vector2, Vector4},
};
use foxhunt_filters::{
    Bank, BatchEstimator, Ckf, Ekf, Gate, GaussianSum, GridConfig, GridFilter, Handover, Imm,
    Iterations, KldSampling, Leading, OutOfOrder, ParticleFilter, RaoBlackwellised, Resampling,
    Transition, Ukf, Unscented, consistency::Monitored, split,
};

use super::{
    edges::rng,
    model::{FIELD, observed},
};

const STILL: RandomWalk<2> = RandomWalk { drift: Vector2::new(0.2, 0.2) };

/// [`FIELD`] of a state that holds more than a place.
#[derive(Clone, Copy, Debug)]
struct Place;

impl<const N: usize> MeasurementModel<N, 2> for Place {
    fn quantities(&self) -> [Quantity; 2] {
        FIELD.quantities()
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector2<f64> {
        FIELD.expected(&state.fixed_rows::<2>(0).into_owned(), receiver)
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 2, N> {
        let place = FIELD.jacobian(&state.fixed_rows::<2>(0).into_owned(), receiver);
        SMatrix::from_fn(|i, j| if j < 2 { place[(i, j)] } else { 0.0 })
    }
}

/// The level with a power that is free, as the third component.
#[derive(Clone, Copy, Debug)]
struct WithPower;

impl MeasurementModel<3, 2> for WithPower {
    fn quantities(&self) -> [Quantity; 2] {
        FIELD.quantities()
    }

    fn expected(&self, state: &State<3>, receiver: &Pose) -> Vector2<f64> {
        let level = FIELD.expected(&state.fixed_rows::<2>(0).into_owned(), receiver);
        level + Vector2::new(state[2], 0.0)
    }
}

/// A place some 50 m from the receiver, known to 3 m, so that level and bearing are nearly linear.
fn place() -> Estimate<2> {
    let covariance = Matrix2::new(9.0, 4.0, 4.0, 9.0);
    Estimate { mean: Vector2::new(-30.0, 4.0), covariance }
}

fn near() -> Pose {
    Pose::at(20.0, 6.0, 10.0)
}

/// A bearing across the seam at half a turn, and a level 2 dB off what is expected.
fn mild() -> Observation<2> {
    let off = Vector2::new(2.0, 0.05);
    observed(near(), FIELD.expected(&place().mean, &near()) + off, 2.0, 0.06)
}

fn moving() -> Estimate<4> {
    let place = place();
    let mut covariance = Matrix4::identity() * 0.25;
    covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place.covariance);
    Estimate { mean: Vector4::new(place.mean.x, place.mean.y, 1.0, -0.5), covariance }
}

fn within(tolerance: f64) -> Checks {
    let predictive = Predictive { tolerance, ..Predictive::default() };
    Checks { predictive: Some(predictive), ..Checks::default() }
}

/// NIS left out: of an estimator that reports its best component's.
fn without_nis(tolerance: f64) -> Checks {
    let predictive = Predictive { tolerance, nis: false, ..Predictive::default() };
    Checks { predictive: Some(predictive), ..Checks::default() }
}

fn ekf() -> Ekf<RandomWalk<2>, super::model::RssBearing, 2, 2> {
    Ekf::new(STILL, FIELD, place()).expect("a proper prior")
}

fn cloud(particles: usize) -> impl Estimator<2, 2> + Clone {
    ParticleFilter::new(STILL, FIELD, place(), particles, rng(1)).expect("a proper prior")
}

#[test]
fn kalman_filters_keep_them_to_the_digits() {
    let exact = within(1e-6);
    laws::estimator_with(ekf, &mild(), exact);
    let wide = Gate::probability(1.0 - 1e-12).expect("in range");
    laws::estimator_with(|| ekf().with_gate(wide), &mild(), exact);
    let ukf = || Ukf::new(STILL, FIELD, place()).expect("a proper prior");
    laws::estimator_with(ukf, &mild(), exact);
    let thin = Unscented::new(0.01, 2.0, 0.0).expect("in range");
    laws::estimator_with(|| ukf().with_transform(thin).expect("in range"), &mild(), exact);
    let ckf = || Ckf::new(STILL, FIELD, place()).expect("a proper prior");
    laws::estimator_with(ckf, &mild(), exact);
    laws::estimator_with(|| Ukf::pritzl2018(FIELD, place()).expect("proper"), &mild(), exact);
    laws::estimator_with(|| Ekf::pritzl2018(FIELD, place()).expect("proper"), &mild(), exact);
    laws::estimator_with(|| OutOfOrder::new(ekf(), 0.0, 5.0).expect("proper"), &mild(), exact);
    laws::estimator_with(|| Monitored::new(ekf(), FIELD), &mild(), exact);
    let straight = ConstantVelocity { spectral_density: 0.04 };
    let fast = || Ekf::new(straight, Place, moving()).expect("a proper prior");
    laws::estimator_with(fast, &mild(), exact);
    laws::estimator_with::<_, 2, 2>(|| Leading::<_, 4>::new(fast()), &mild(), exact);
}

/// An iterated update is about its own posterior: no longer linear in the observation.
#[test]
fn iterated_filters_keep_them_to_a_part_in_twenty() {
    let five = Iterations::at_most(5).expect("at least one");
    laws::estimator_with(|| ekf().with_iterations(five), &mild(), within(0.05));
    let ckf = || Ckf::new(STILL, FIELD, place()).expect("a proper prior").with_iterations(five);
    laws::estimator_with(ckf, &mild(), within(0.05));
    let batch = || BatchEstimator::new(STILL, FIELD, place()).expect("a proper prior");
    laws::estimator_with(batch, &mild(), within(0.05));
}

#[test]
fn mixtures_keep_them() {
    let parts = split(&place(), [4, 3]).expect("a proper prior");
    let sum = || GaussianSum::new(&ekf(), parts.clone()).expect("proper");
    laws::estimator_with(sum, &mild(), within(0.01));
    let bank = || Bank::new([(0.3, ekf()), (0.7, ekf())]).expect("proper");
    laws::estimator_with(bank, &mild(), within(1e-6));
    let bank = || bank().with_innovation(Ekf::innovation);
    laws::estimator_with(bank, &mild(), within(1e-6));
    let still = RandomWalk { drift: Vector4::new(0.1, 0.1, 0.01, 0.01) };
    let straight = ConstantVelocity { spectral_density: 0.04 };
    let models: [&dyn MotionModel<4>; 2] = [&still, &straight];
    let imm = || {
        let ukf = |motion| Ukf::new(motion, Place, moving()).expect("a proper prior");
        let chain = Transition::sojourn(&[30.0, 10.0]).expect("positive");
        Imm::new(models.map(|m| (0.5, ukf(m))), chain).expect("proper")
    };
    laws::estimator_with(imm, &mild(), within(1e-3));
    laws::estimator_with(|| imm().with_innovation(Ukf::innovation), &mild(), within(1e-3));
}

#[test]
fn clouds_keep_them() {
    laws::estimator_with(|| cloud(3000), &mild(), within(1e-3));
    let make = |particles| {
        ParticleFilter::new(STILL, FIELD, place(), particles, rng(1)).expect("a proper prior")
    };
    for scheme in [Resampling::Multinomial, Resampling::Stratified, Resampling::Residual] {
        let filter = || {
            let filter = make(1500).with_resampling(scheme);
            filter.with_resampling_threshold(1.0).expect("in range")
        };
        laws::estimator_with(filter, &mild(), within(1e-3));
    }
    let smooth = || make(1500).with_kernel_bandwidth(0.3).expect("in range");
    laws::estimator_with(smooth, &mild(), within(1e-3));
    let adaptive = || {
        let size = KldSampling::new(Vector2::repeat(1.0), 1000, 2000).expect("in range");
        let filter = make(1500).with_progressive_correction(0.5).expect("in range");
        filter.with_adaptive_size(size)
    };
    laws::estimator_with(adaptive, &mild(), within(1e-3));
    let boxed = || -> Box<dyn Estimator<2, 2>> { Box::new(cloud(1500)) };
    laws::estimator_with(boxed, &mild(), within(1e-3));
    let walk = RandomWalk { drift: SVector::<f64, 3>::new(0.2, 0.2, 0.0) };
    let mut prior = Estimate::isotropic(place().mean.push(0.5), 1.5);
    prior.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place().covariance);
    let marginal = || {
        RaoBlackwellised::<_, _, _, 3, 2, 1>::new(walk, WithPower, prior, 1500, rng(1))
            .expect("a proper prior")
    };
    laws::estimator_with(marginal, &mild(), within(1e-3));
}

#[test]
fn cells_keep_them() {
    let config = GridConfig { side: 48, ..GridConfig::default() };
    let grid = || GridFilter::new(STILL, FIELD, place(), config.clone()).expect("proper");
    laws::estimator_with(grid, &mild(), within(0.02));
    let ekf = |first| Ekf::new(STILL, FIELD, first);
    laws::estimator_with(|| Handover::new(grid(), 1, ekf), &mild(), without_nis(0.02));
}

/// A mistake between an estimator and the laws.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mistake {
    None,
    /// Angles outside ±π are brought back by 6.27 rad.
    Wrap,
    GrowingCovariance,
    HalvedCovariance,
    ShiftedMean,
    Evidence,
    HalvedNis,
}

struct Mistaken<E> {
    estimator: E,
    mistake: Mistake,
    updated: bool,
}

impl<E: Estimator<2, 2>> Estimator<2, 2> for Mistaken<E> {
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        self.estimator.predict(dt)
    }

    fn update(&mut self, observation: &Observation<2>) -> Result<Correction, EstimatorError> {
        let bearing = observation.value()[1];
        let turns = (bearing / TAU).round();
        let mut seen = *observation;
        if self.mistake == Mistake::Wrap && turns.abs() > 0.0 {
            let value = Vector2::new(observation.value()[0], bearing - turns * 6.27);
            let whole = Observation::new(0.0, near(), value, observation.noise()).expect("proper");
            seen = (0..2).filter(|i| !observation.has(*i)).fold(whole, Observation::without);
        }
        let correction = self.estimator.update(&seen)?;
        self.updated |= correction != Correction::Empty;
        let Correction::Fused { mut nis, mut log_evidence, effective_sample_size } = correction
        else {
            return Ok(correction);
        };
        match self.mistake {
            Mistake::Evidence => log_evidence += 1.0,
            Mistake::HalvedNis => nis = nis.map(|nis| nis / 2.0),
            _ => {}
        }
        Ok(Correction::Fused { nis, log_evidence, effective_sample_size })
    }

    fn estimate(&self) -> Estimate<2> {
        let Estimate { mut mean, mut covariance } = self.estimator.estimate();
        match self.mistake {
            Mistake::GrowingCovariance if self.updated => covariance *= 1.2,
            Mistake::HalvedCovariance if self.updated => covariance *= 0.5,
            Mistake::ShiftedMean if self.updated => mean.x += 0.6,
            _ => {}
        }
        Estimate { mean, covariance }
    }

    fn quantities(&self) -> [Quantity; 2] {
        self.estimator.quantities()
    }
}

/// The message of the breach that a mistake makes, if any.
fn breach<E: Estimator<2, 2>>(make: impl Fn() -> E, mistake: Mistake) -> Option<String> {
    // A worthless component still shrinks a halved covariance: that law would find it by luck.
    let checks = Checks { worthless_tolerance: None, ..within(0.01) };
    let fresh = || Mistaken { estimator: make(), mistake, updated: false };
    let checked = AssertUnwindSafe(|| laws::estimator_with(fresh, &mild(), checks));
    let payload = catch_unwind(checked).err()?;
    Some(payload.downcast_ref::<String>().expect("a formatted message").clone())
}

#[test]
fn each_mistake_is_found_by_its_law_and_by_no_other() {
    let breaches = [
        "another posterior",
        "exp(log_evidence) integrates to",
        "E[m⁺] is off",
        "E[P⁺] + Var[m⁺] is off",
        "E[NIS] is",
    ];
    for (mistake, found) in [
        (Mistake::Wrap, "turns gives another posterior"),
        (Mistake::GrowingCovariance, "E[P⁺] + Var[m⁺] is off the prior's P by 0."),
        (Mistake::HalvedCovariance, "E[P⁺] + Var[m⁺] is off the prior's P by 0."),
        (Mistake::ShiftedMean, "E[m⁺] is off the prior's mean by 0."),
        (Mistake::Evidence, "exp(log_evidence) integrates to 2.71"),
        (Mistake::HalvedNis, "E[NIS] is 0.5"),
    ] {
        for message in [
            breach(ekf, mistake).expect("a Kalman filter with a mistake"),
            breach(|| cloud(3000), mistake).expect("a cloud with a mistake"),
        ] {
            assert!(message.contains(found), "{mistake:?}: {message}");
            let others = breaches.iter().filter(|other| !found.contains(**other));
            for other in others {
                let own = mistake == Mistake::ShiftedMean && other.starts_with("E[P");
                assert!(own || !message.contains(other), "{mistake:?}: {message}");
            }
        }
    }
    assert_eq!(breach(ekf, Mistake::None), None);
    assert_eq!(breach(|| cloud(3000), Mistake::None), None);
}

/// A model whose density is e times too large.
#[derive(Clone, Copy)]
struct TooLikely;

impl MeasurementModel<2, 2> for TooLikely {
    fn quantities(&self) -> [Quantity; 2] {
        FIELD.quantities()
    }

    fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector2<f64> {
        FIELD.expected(state, receiver)
    }

    fn log_likelihood(&self, state: &State<2>, observation: &Observation<2>) -> f64 {
        let more = if observation.is_empty() { 0.0 } else { 1.0 };
        FIELD.log_likelihood(state, observation) + more
    }
}

#[test]
#[should_panic(expected = "the likelihood integrates to 2.718282 over all measurements, not to 1")]
fn a_likelihood_that_is_no_density_is_found() {
    laws::measurement_model(&TooLikely, &place().mean, &mild());
}

#[test]
fn a_problem_that_takes_too_many_updates_is_refused_by_name() {
    let prior = Estimate::isotropic(Vector1::new(0.0), 1e9);
    let line = || Ekf::new(RandomWalk::uniform(0.1), Line, prior).expect("a proper prior");
    let z = Observation::new(0.0, Pose::default(), Vector1::new(0.0), SMatrix::identity());
    let z = z.expect("proper");
    let checks = Checks { worthless_tolerance: None, ..Checks::default() };
    let checked = catch_unwind(AssertUnwindSafe(|| laws::estimator_with(line, &z, checks)));
    let payload = checked.expect_err("too many nodes");
    let message = payload.downcast_ref::<String>().expect("a formatted message");
    assert!(message.contains("component 0 is uncertain by more than 100000 σ"), "{message}");
}

#[derive(Clone, Copy)]
struct Line;

impl MeasurementModel<1, 1> for Line {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::linear("x_m")]
    }

    fn expected(&self, state: &State<1>, _: &Pose) -> Vector1<f64> {
        *state
    }
}
