//! A transmitter of unknown power: the power and the exponent integrated out of each particle.

use foxhunt_core::{
    Axis, BearingMode, BearingModes, ConstantVelocity, Correction, Estimate, Estimator,
    EstimatorError, MeasurementModel, Observation, Pose, RandomWalk, State, laws,
    nalgebra::{DMatrix, DVector, Matrix2x3, Vector2, Vector3, Vector4},
};
use foxhunt_filters::{RaoBlackwellised, Resampling, consistency::ChiSquaredAverage};
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use crate::{
    edges::rng,
    model::{FIELD, heard},
};

/// (E, N, P₀) and z = [P₀ − 27.65 log₁₀ d, bearing].
#[derive(Clone, Copy)]
struct FreePower;

impl MeasurementModel<3, 2> for FreePower {
    fn axes(&self) -> [Axis; 2] {
        FIELD.axes()
    }
    fn expected(&self, state: &State<3>, receiver: &Pose) -> Vector2<f64> {
        let field = FIELD.expected(&state.fixed_rows::<2>(0).into_owned(), receiver);
        field + Vector2::new(state[2] - FIELD.p0_dbm, 0.0)
    }
    fn jacobian(&self, state: &State<3>, receiver: &Pose) -> Matrix2x3<f64> {
        let place = FIELD.jacobian(&state.fixed_rows::<2>(0).into_owned(), receiver);
        let mut jacobian = Matrix2x3::zeros();
        jacobian.fixed_columns_mut::<2>(0).copy_from(&place);
        jacobian[(0, 2)] = 1.0;
        jacobian
    }
}

/// (E, N, P₀, γ); its Jacobian is left to differences.
#[derive(Clone, Copy)]
struct FreePathLoss;

impl MeasurementModel<4, 2> for FreePathLoss {
    fn axes(&self) -> [Axis; 2] {
        FIELD.axes()
    }
    fn expected(&self, state: &State<4>, receiver: &Pose) -> Vector2<f64> {
        let d = state.fixed_rows::<2>(0) - receiver.position.xy();
        let range = libm::hypot(d.norm(), receiver.position.z);
        let rss_dbm = state[2] - 10.0 * state[3] * libm::log10(range);
        Vector2::new(rss_dbm, libm::atan2(d.y, d.x))
    }
}

type Power = RaoBlackwellised<RandomWalk<3>, FreePower, Xoshiro256PlusPlus, 3, 2, 1>;

fn prior() -> Estimate<3> {
    let deviations = Vector3::new(15.0, 15.0, 10.0);
    Estimate {
        mean: Vector3::new(6.0, -3.0, -30.0),
        covariance: foxhunt_core::Covariance::from_diagonal(&deviations.component_mul(&deviations)),
    }
}

fn filter(drift: f64, particles: usize, seed: u64) -> Power {
    let walk = RandomWalk { drift: Vector3::new(drift, drift, 0.0) };
    RaoBlackwellised::new(walk, FreePower, prior(), particles, rng(seed)).expect("a proper prior")
}

fn observe(step: u8, level: f64, bearing: f64, sigma: f64) -> Observation<2> {
    let around = 2.1 * f64::from(step);
    let receiver = Pose::at(6.0 + 25.0 * around.cos(), -3.0 + 25.0 * around.sin(), 4.0);
    let whole = heard(receiver, Vector2::new(level, bearing), 4.0, sigma);
    match step % 4 {
        1 => whole.without(1),
        2 => whole.without(0),
        _ => whole,
    }
}

/// Observations of a target at (20, 8) whose power is −41 dBm, with the noise of seed 3.
fn flight(sigma: f64) -> Vec<Observation<2>> {
    let mut rng = rng(3);
    let truth = Vector3::new(20.0, 8.0, -41.0);
    (0..8)
        .map(|step| {
            let at = observe(step, 0.0, 0.0, sigma);
            let mut white = || -> f64 { rng.sample(StandardNormal) };
            let z = FreePower.expected(&truth, at.receiver());
            observe(step, z[0] + 4.0 * white(), z[1] + sigma * white(), sigma)
        })
        .collect()
}

/// The exact posterior of a still target after all of `heard`, on a grid: at each place levels are
/// jointly Gaussian, with the common variance of the power.
fn exact(heard: &[Observation<2>]) -> (Estimate<3>, f64) {
    let levels: Vec<_> = heard.iter().filter(|o| o.has(0)).collect();
    let count = levels.len();
    let covariance =
        DMatrix::from_element(count, count, 100.0) + DMatrix::identity(count, count) * 16.0;
    let factor = covariance.cholesky().expect("definite");
    let log_root: f64 = factor.l().diagonal().iter().map(|d: &f64| libm::log(*d)).sum();
    let tau = core::f64::consts::TAU;
    let (mut total, mut mean, mut square) =
        (0.0, Vector3::zeros(), foxhunt_core::Covariance::<3>::zeros());
    const CELLS: i32 = 400;
    let side = 150.0 / f64::from(CELLS);
    for (i, j) in (0..CELLS).flat_map(|i| (0..CELLS).map(move |j| (i, j))) {
        let off = Vector2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) * side;
        let off = off - Vector2::repeat(75.0);
        let place = Vector3::new(6.0 + off.x, -3.0 + off.y, -30.0);
        let residual = DVector::from_iterator(
            count,
            levels.iter().map(|o| o.value()[0] - FreePower.expected(&place, o.receiver())[0]),
        );
        let weighed = factor.solve(&residual);
        let mut log = -0.5 * (residual.dot(&weighed) + off.norm_squared() / 225.0)
            - log_root
            - 0.5 * f64::from(u32::try_from(count).expect("few")) * tau.ln()
            - (tau * 225.0).ln()
            + 2.0 * side.ln();
        for o in heard.iter().filter(|o| o.has(1)) {
            log += FreePower.log_likelihood(&place, &o.without(0));
        }
        // The power given the place: prior −30, variance 100, all levels.
        let power = place[2] + 100.0 * weighed.sum();
        let ones = DVector::from_element(count, 1.0);
        let variance = 100.0 - 1e4 * ones.dot(&factor.solve(&ones));
        let (weight, at) = (log.exp(), Vector3::new(place.x, place.y, power));
        total += weight;
        mean += at * weight;
        square += at * at.transpose() * weight;
        square[(2, 2)] += variance * weight;
    }
    let mean = mean / total;
    let covariance = square / total - mean * mean.transpose();
    (Estimate { mean, covariance: (covariance + covariance.transpose()) * 0.5 }, total.ln())
}

/// How far the filter is from the exact posterior after the flight: its mean in standard
/// deviations, its covariance as a share, and its log-evidence.
fn off(sigma: f64, with: impl Fn(Power) -> Power) -> (f64, f64, f64) {
    let heard = flight(sigma);
    let (exact, exact_evidence) = exact(&heard);
    let mut filter = with(filter(0.0, 10_000, 4));
    let mut log_evidence = 0.0;
    for observation in &heard {
        filter.predict(1.0).expect("a proper step");
        match filter.update(observation).expect("possible") {
            Correction::Fused { log_evidence: told, .. } => log_evidence += told,
            other => panic!("not fused: {other:?}"),
        }
    }
    let told = filter.estimate();
    let white = exact.nees(&told.mean).expect("definite").sqrt();
    let ratio = (told.covariance - exact.covariance).norm() / exact.covariance.norm();
    (white, ratio, (log_evidence - exact_evidence).abs())
}

#[test]
fn it_reaches_the_exact_posterior() {
    // The growth of a cloud's own errors, 1 / √10 000, over eight updates; what the kernel
    // smooths is more.
    for scheme in [Resampling::Systematic, Resampling::Residual] {
        let told = off(0.3, |filter| filter.with_resampling(scheme));
        assert!(told.0 < 0.15 && told.1 < 0.15 && told.2 < 0.15, "{scheme:?}: {told:?}");
    }
    // In stages at nearly every update: each time the kernel smooths a thin belief, which in the
    // end costs a fifth of a standard deviation and a third in the log-evidence.
    let staged = off(0.03, |filter| filter.with_progressive_correction(0.5).expect("in range"));
    assert!(staged.0 < 0.3 && staged.1 < 0.2 && staged.2 < 0.5, "{staged:?}");
}

#[test]
fn its_samples_have_its_moments() {
    let mut filter = filter(0.1, 500, 2);
    for observation in flight(0.3) {
        filter.predict(1.0).expect("a proper step");
        let _ = filter.update(&observation).expect("possible");
    }
    let told = filter.estimate();
    let (mut total, mut square) = (0.0, foxhunt_core::Covariance::<3>::zeros());
    filter.visit_samples(&mut |x, w| {
        total += w;
        square += (x - told.mean) * (x - told.mean).transpose() * w;
    });
    assert!((total - 1.0).abs() < 1e-12);
    // But for what the cloud misses, next to nothing here.
    assert!((square - told.covariance).norm() < 0.01 * told.covariance.norm());
}

#[test]
fn what_is_not_sampled_drifts_by_its_own_noise() {
    let walk = RandomWalk { drift: Vector3::new(0.0, 0.0, 3.0) };
    let made = RaoBlackwellised::<_, _, _, 3, 2, 1>::new(walk, FreePower, prior(), 500, rng(1));
    let mut filter = made.expect("a proper prior");
    let before = filter.estimate();
    filter.predict(4.0).expect("a proper step");
    let grown = filter.estimate().covariance - before.covariance;
    // But for what the cloud misses, a millionth of the covariance or so.
    assert!((grown[(2, 2)] - 36.0).abs() < 0.01, "{grown}");
    assert!((filter.estimate().mean - before.mean).norm() < 1e-9);
}

#[test]
fn it_keeps_the_laws() {
    let fresh = || filter(0.2, 300, 1);
    for (level, bearing, sigma) in [(-70.0, 0.4, 0.3), (-90.0, -3.1, 0.02), (-40.0, 2.0, 1.5)] {
        laws::estimator(
            fresh,
            &heard(Pose::at(1.0, 2.0, 4.0), Vector2::new(level, bearing), 4.0, sigma),
        );
    }
    // Two things alike run alike.
    let run = || {
        let mut filter = fresh();
        for observation in flight(0.3) {
            filter.predict(1.0).expect("a proper step");
            let _ = filter.update(&observation).expect("possible");
        }
        filter.estimate()
    };
    assert_eq!(run(), run());
}

#[test]
fn a_sampled_part_that_moves_with_the_rest_is_refused() {
    // Places move with velocities: these cannot be left to a filter that is told of no step.
    let motion = ConstantVelocity { acceleration_density: 0.1 };
    let prior = Estimate::isotropic(Vector4::zeros(), 5.0);
    let made = RaoBlackwellised::<_, _, _, 4, 2, 2>::new(motion, FreePathLoss, prior, 50, rng(1));
    let mut filter = made.expect("a proper prior");
    let before = filter.estimate();
    assert!(matches!(filter.predict(1.0), Err(EstimatorError::Parameter { .. })));
    assert_eq!(filter.estimate(), before);
    let few = RaoBlackwellised::<_, _, _, 4, 2, 2>::new(motion, FreePathLoss, prior, 4, rng(1));
    assert!(few.is_err());
    assert!(filter.with_progressive_correction(0.7).is_err());
}

/// The NEES of the place over `runs` hunts whose truth is drawn from the prior, from seeds 500 on.
fn drawn<const N: usize, const K: usize, H: MeasurementModel<N, 2> + Copy>(
    model: H,
    prior: Estimate<N>,
    drift: f64,
    sigma: f64,
    runs: u64,
) -> ChiSquaredAverage {
    let walk = RandomWalk { drift: State::from_fn(|row, _| if row < 2 { drift } else { 0.0 }) };
    let mut anees = ChiSquaredAverage::new(0.95).expect("in (0, 1)");
    let root = prior.covariance.cholesky().expect("definite").unpack();
    for seed in 500..500 + runs {
        let mut draws = rng(seed);
        let mut white = || -> f64 { draws.sample(StandardNormal) };
        let mut truth = prior.mean + root * State::<N>::from_fn(|_, _| white());
        let made = RaoBlackwellised::<_, _, _, N, 2, K>::new(
            walk,
            model,
            prior,
            4000,
            rng(seed + 1_000_000),
        );
        let mut filter = made.expect("a proper prior");
        for step in 0..10 {
            truth[0] += drift * white();
            truth[1] += drift * white();
            let at = observe(step, 0.0, 0.0, sigma);
            let z = model.expected(&truth, at.receiver());
            let z = observe(step, z[0] + 4.0 * white(), z[1] + sigma * white(), sigma);
            filter.predict(1.0).expect("a proper step");
            let _ = filter.update(&z).expect("possible");
        }
        let place = filter.estimate().position();
        anees.add(place.nees(&truth.fixed_rows::<2>(0).into_owned()).expect("definite"), 2);
    }
    anees
}

#[test]
fn it_is_consistent_with_unknown_power_and_exponent() {
    // 50 and 30 runs; E[NEES] = 2 whatever the posterior's shape. 3.3 standard errors of the
    // sample's own scatter, and a twentieth for what 4000 particles miss of the prior's tails
    // (over 100 runs of a walking target: 2.8 ± 0.8 of 1000, 2.06 ± 0.29 of 4000, 1.99 ± 0.25 of
    // 10 000 particles).
    let deviations = Vector4::new(15.0, 15.0, 10.0, 0.4);
    let loss = Estimate {
        mean: Vector4::new(6.0, -3.0, -30.0, 2.8),
        covariance: foxhunt_core::Covariance::from_diagonal(&deviations.component_mul(&deviations)),
    };
    let ways = [
        ("power, still", drawn::<3, 1, _>(FreePower, prior(), 0.0, 0.3, 50)),
        ("exponent", drawn::<4, 2, _>(FreePathLoss, loss, 0.02, 0.3, 30)),
    ];
    for (name, anees) in ways {
        let (mean, error) = (anees.average().expect("some"), anees.standard_error().expect("some"));
        assert!((mean - 2.0).abs() < 3.3 * error + 0.1, "{name}: ANEES {mean} ± {error}");
        assert!(error < 0.6, "{name}: {error} tells nothing");
    }
}

/// What is likely under either direction is likely under both in proportion, and so are the means: the
/// posterior is the mixture of the two posteriors, in each particle and so in the cloud.
#[test]
fn competing_bearings_are_the_mixture_of_their_posteriors() {
    let mode = |weight, angle, sigma| BearingMode { weight, angle, sigma };
    let modes = BearingModes::new(&[mode(0.6, 0.4, 0.3), mode(0.4, 2.6, 0.5)]).expect("proper");
    let both = observe(0, -75.0, 0.0, 0.3).with_bearing_modes(1, modes);
    // Without stages nothing is drawn anew, and what remains is exact.
    let start = filter(0.0, 500, 5).with_progressive_correction(0.0).expect("in range");
    let fused = |observation: &Observation<2>| {
        let mut filter = start.clone();
        let Ok(Correction::Fused { log_evidence, .. }) = filter.update(observation) else {
            panic!("it was not fused");
        };
        (log_evidence, filter.estimate().mean)
    };
    let (evidence, mean) = fused(&both);
    let (mut sum, mut centre) = (0.0, Vector3::zeros());
    for (weight, one) in both.hypotheses() {
        let (log, mean) = fused(&one);
        let share = weight * log.exp();
        (sum, centre) = (sum + share, centre + mean * share);
    }
    assert!((evidence - sum.ln()).abs() < 1e-9, "{evidence} for {}", sum.ln());
    assert!((mean - centre / sum).norm() < 1e-6, "{mean} for {}", centre / sum);
}
