//! A transmitter of unknown power: the power and the exponent integrated out of each particle.

use approx::assert_abs_diff_eq;
use foxhunt_core::{
    BearingMode, BearingModes, ConstantVelocity, Correction, Estimate, Estimator, EstimatorError,
    MeasurementModel, Observation, Pose, Quantity, RandomWalk, State, laws,
    nalgebra::{DMatrix, DVector, Matrix1, Matrix2x3, Matrix3, Vector1, Vector2, Vector3, Vector4},
};
use foxhunt_filters::{
    Ekf, RaoBlackwellised, Resampling,
    consistency::{ChiSquaredAverage, Verdict},
};
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::{
    edges::rng,
    model::{FIELD, observed},
};

/// (E, N, P₀) and z = [P₀ − 27.65 log₁₀ d, bearing].
#[derive(Clone, Copy)]
struct FreePower;

impl MeasurementModel<3, 2> for FreePower {
    fn quantities(&self) -> [Quantity; 2] {
        FIELD.quantities()
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
    fn quantities(&self) -> [Quantity; 2] {
        FIELD.quantities()
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
    let whole = observed(receiver, Vector2::new(level, bearing), 4.0, sigma);
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

/// The exact posterior of a still target after all of `observed`, on a grid: at each place levels
/// are jointly Gaussian, with the common variance of the power.
fn exact(observed: &[Observation<2>]) -> (Estimate<3>, f64) {
    let levels: Vec<_> = observed.iter().filter(|o| o.has(0)).collect();
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
        for o in observed.iter().filter(|o| o.has(1)) {
            log += FreePower.log_likelihood(&place, &o.without(0));
        }
        // The power given the place: prior −30, variance 100, all levels.
        let power = place[2] + 100.0 * weighed.sum();
        let ones = DVector::from_element(count, 1.0);
        let variance = 100.0 - 1e4 * ones.dot(&factor.solve(&ones));
        let weight = log.exp();
        let at = Vector3::new(place.x, place.y, power);
        total += weight;
        mean += at * weight;
        square += at * at.transpose() * weight;
        square[(2, 2)] += variance * weight;
    }
    let mean = mean / total;
    let covariance = square / total - mean * mean.transpose();
    (Estimate { mean, covariance: (covariance + covariance.transpose()) * 0.5 }, total.ln())
}

/// Returns the filter's distance from the exact posterior after the flight: its mean in standard
/// deviations, its covariance as a share, and its log-evidence.
fn off(sigma: f64, with: impl Fn(Power) -> Power) -> (f64, f64, f64) {
    let observed = flight(sigma);
    let (exact, exact_evidence) = exact(&observed);
    let mut filter = with(filter(0.0, 10_000, 4));
    let mut log_evidence = 0.0;
    for observation in &observed {
        filter.predict(1.0).expect("a proper step");
        match filter.update(observation).expect("possible") {
            Correction::Fused { log_evidence: reported, .. } => log_evidence += reported,
            other => panic!("not fused: {other:?}"),
        }
    }
    let reported = filter.estimate();
    let white = exact.nees(&reported.mean).expect("definite").sqrt();
    let ratio = (reported.covariance - exact.covariance).norm() / exact.covariance.norm();
    (white, ratio, (log_evidence - exact_evidence).abs())
}

#[test]
fn it_reaches_the_exact_posterior() {
    // The growth of a cloud's own errors, 1 / √10 000, over eight updates; what the kernel
    // smooths is more.
    for scheme in [Resampling::Systematic, Resampling::Residual] {
        let reported = off(0.3, |filter| filter.with_resampling(scheme));
        assert!(
            reported.0 < 0.15 && reported.1 < 0.15 && reported.2 < 0.15,
            "{scheme:?}: {reported:?}"
        );
    }
    // In stages at nearly every update: each time the kernel smooths a thin belief, which in the
    // end costs a fifth of a standard deviation and a third in the log-evidence.
    let staged = off(0.03, |filter| filter.with_progressive_correction(0.5).expect("in range"));
    assert!(staged.0 < 0.3 && staged.1 < 0.2 && staged.2 < 0.5, "{staged:?}");
}

/// East and a level that depends on the power, both linear in the state.
#[derive(Clone, Copy)]
struct Straight;

impl MeasurementModel<3, 2> for Straight {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::linear("east_and_power"), Quantity::linear("north_m")]
    }
    fn expected(&self, x: &State<3>, _: &Pose) -> Vector2<f64> {
        Vector2::new(0.5 * x[0] + x[2], x[1] - 0.3 * x[0])
    }
}

/// Seed 6, 20 000 particles: 1 % of the covariance each update, and the kernel's.
#[test]
fn a_linear_problem_comes_out_as_the_kalman_filter() {
    let factor = Matrix3::new(5.0, 0.0, 0.0, 1.0, 4.0, 0.0, -2.0, 1.0, 3.0);
    let mean = Vector3::new(6.0, -3.0, -30.0);
    let prior = Estimate { mean, covariance: factor * factor.transpose() };
    let walk = RandomWalk { drift: Vector3::new(0.5, 0.8, 0.6) };
    let made = RaoBlackwellised::<_, _, _, 3, 2, 1>::new(walk, Straight, prior, 20_000, rng(6));
    let mut cloud = made.expect("a proper prior");
    let mut kalman = Ekf::new(walk, Straight, prior).expect("a proper prior");
    for (level, north) in [(-28.0, -4.0), (-26.0, -6.5), (-27.0, -5.0), (-25.5, -5.5)] {
        let observation = observed(Pose::default(), Vector2::new(level, north), 2.0, 1.5);
        let mut evidence = [0.0; 2];
        let both: [&mut dyn Estimator<3, 2>; 2] = [&mut cloud, &mut kalman];
        for (evidence, filter) in evidence.iter_mut().zip(both) {
            filter.predict(1.0).expect("a proper step");
            match filter.update(&observation).expect("possible") {
                Correction::Fused { log_evidence, .. } => *evidence = log_evidence,
                other => panic!("not fused: {other:?}"),
            }
        }
        assert_abs_diff_eq!(evidence[0], evidence[1], epsilon = 0.05);
        let reported = cloud.estimate();
        let exact = kalman.estimate();
        let nees = exact.nees(&reported.mean).expect("definite");
        assert!(nees < 0.05 * 0.05, "the mean is off by {} deviations", nees.sqrt());
        // In units of the exact covariance, so that each direction counts alike.
        let root = exact.covariance.cholesky().expect("definite").l();
        let inverse = root.try_inverse().expect("regular");
        let ratio = inverse * reported.covariance * inverse.transpose() - Matrix3::identity();
        assert!(ratio.norm() < 0.06, "the covariance is off by {ratio}");
    }
}

#[test]
fn a_thin_cloud_adds_the_share_that_it_misses() {
    // One precise bearing leaves few of 200 particles of two sampled dimensions: cells of
    // 200^(−2/2) of the belief's covariance, times 1 / ESS − 1 / 200.
    let mut filter = filter(0.0, 200, 8).with_progressive_correction(0.0).expect("in range");
    let before = filter.estimate().covariance;
    let at = observe(0, 0.0, 0.0, 0.05).without(0);
    let z = FreePower.expected(&Vector3::new(20.0, 8.0, -30.0), at.receiver());
    let _ = filter.update(&observe(0, 0.0, z[1], 0.05).without(0)).expect("possible");
    let size = filter.effective_sample_size();
    assert!(size < 30.0, "{size} particles are left");
    let reported = filter.estimate();
    let mut square = Matrix3::zeros();
    filter.visit_samples(&mut |x, w| {
        square += (x - reported.mean) * (x - reported.mean).transpose() * w;
    });
    let missed = before * ((1.0 / size - 1.0 / 200.0) / 200.0);
    let error = reported.covariance - square - missed;
    let place = error.fixed_view::<2, 2>(0, 0).norm() / missed.fixed_view::<2, 2>(0, 0).norm();
    assert!(place < 1e-6, "off by {place} of what is missed");
}

/// The distance from the line North = 0 along East.
#[derive(Clone, Copy)]
struct Sides;

impl MeasurementModel<2, 1> for Sides {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::linear("distance_m")]
    }
    fn expected(&self, x: &State<2>, _: &Pose) -> Vector1<f64> {
        Vector1::new(x[0].abs())
    }
}

/// Seed 9, 4000 particles: the variance of 2000 draws is good to 3.2 % (1 σ).
#[test]
fn copies_are_set_apart_by_the_bandwidth_of_what_is_sampled() {
    let prior = Estimate::isotropic(Vector2::zeros(), 10.0);
    let still = RandomWalk::uniform(1e-9);
    let made = RaoBlackwellised::<_, _, _, 2, 1, 1>::new(still, Sides, prior, 4000, rng(9));
    let mut filter = made.expect("a proper prior").with_progressive_correction(0.0);
    let filter = filter.as_mut().expect("in range");
    let noise = Matrix1::new(0.3 * 0.3);
    let observation =
        Observation::new(0.0, Pose::default(), Vector1::new(10.0), noise).expect("proper");
    let _ = filter.update(&observation).expect("possible");
    let across = filter.estimate().covariance[(0, 0)];
    filter.predict(1.0).expect("a proper step");
    // Half of the particles at 10, half at −10: the kernel's own spread shows in each.
    let mut weight = 0.0;
    let mut first = 0.0;
    let mut second = 0.0;
    filter.visit_samples(&mut |x, w| {
        if x[0] > 0.0 {
            weight += w;
            first += w * x[0];
            second += w * x[0] * x[0];
        }
    });
    let variance = second / weight - (first / weight).powi(2);
    // Silverman's in one dimension.
    let bandwidth = (4.0 / (3.0 * 4000.0_f64)).powf(0.2);
    let expected = bandwidth * bandwidth * across + (1.0 - bandwidth * bandwidth) * 0.09;
    assert_abs_diff_eq!(variance / expected, 1.0, epsilon = 0.12);
}

#[test]
fn its_samples_have_its_moments() {
    let mut filter = filter(0.1, 500, 2);
    for observation in flight(0.3) {
        filter.predict(1.0).expect("a proper step");
        let _ = filter.update(&observation).expect("possible");
    }
    let reported = filter.estimate();
    let mut total = 0.0;
    let mut square = foxhunt_core::Covariance::<3>::zeros();
    filter.visit_samples(&mut |x, w| {
        total += w;
        square += (x - reported.mean) * (x - reported.mean).transpose() * w;
    });
    assert_abs_diff_eq!(total, 1.0, epsilon = 1e-12);
    // But for what the cloud misses, next to nothing here.
    assert!((square - reported.covariance).norm() < 0.01 * reported.covariance.norm());
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
    assert_abs_diff_eq!(grown[(2, 2)], 36.0, epsilon = 0.01);
    assert!((filter.estimate().mean - before.mean).norm() < 1e-9);
}

#[test]
fn it_keeps_the_laws() {
    let fresh = || filter(0.2, 300, 1);
    for (level, bearing, sigma) in [(-70.0, 0.4, 0.3), (-90.0, -3.1, 0.02), (-40.0, 2.0, 1.5)] {
        laws::estimator_with(
            fresh,
            &observed(Pose::at(1.0, 2.0, 4.0), Vector2::new(level, bearing), 4.0, sigma),
            laws::Checks::AT_ONE_OBSERVATION,
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
    // Places move with velocities: these cannot be left to a filter that is reported of no step.
    let motion = ConstantVelocity { spectral_density: 0.01 };
    let prior = Estimate::isotropic(Vector4::zeros(), 5.0);
    let made = RaoBlackwellised::<_, _, _, 4, 2, 2>::new(motion, FreePathLoss, prior, 50, rng(1));
    let mut filter = made.expect("a proper prior");
    let before = filter.estimate();
    assert!(matches!(filter.predict(1.0), Err(EstimatorError::Parameter(_))));
    assert_eq!(filter.estimate(), before);
    let few = RaoBlackwellised::<_, _, _, 4, 2, 2>::new(motion, FreePathLoss, prior, 4, rng(1));
    assert!(few.is_err());
    assert!(filter.with_progressive_correction(0.7).is_err());
}

/// The NEES of the place over 400 hunts whose truth is drawn from the prior, from seeds 500 on:
/// a good prior and a drone at a distance, where the posterior is nearly Gaussian.
fn drawn<const N: usize, const K: usize, H: MeasurementModel<N, 2> + Copy>(
    model: H,
    prior: Estimate<N>,
    drift: f64,
) -> ChiSquaredAverage {
    let walk = RandomWalk { drift: State::from_fn(|row, _| if row < 2 { drift } else { 0.0 }) };
    let mut anees = ChiSquaredAverage::new(0.999).expect("in (0, 1)");
    let root = prior.covariance.cholesky().expect("definite").unpack();
    for seed in 500..900 {
        let mut draws = rng(seed);
        let mut white = || -> f64 { draws.sample(StandardNormal) };
        let mut truth = prior.mean + root * State::<N>::from_fn(|_, _| white());
        let own = rng(seed + 1_000_000);
        let made = RaoBlackwellised::<_, _, _, N, 2, K>::new(walk, model, prior, 250, own);
        let mut filter = made.expect("a proper prior");
        for step in 0..8 {
            truth[0] += drift * white();
            truth[1] += drift * white();
            let at = observe(step, 0.0, 0.0, 0.1);
            let z = model.expected(&truth, at.receiver());
            let z = observe(step, z[0] + 4.0 * white(), z[1] + 0.1 * white(), 0.1);
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
    // χ²'s interval at 99.9 % is 2 ± 0.33 for 400 runs: a covariance that is 1.3 times too large
    // or too small, 1.54 or 2.6, is outside of it.
    let place = Estimate::isotropic(Vector2::new(6.0, -3.0), 2.5);
    let power = place.with_rest::<3>(-30.0, 6.0);
    let mut loss = place.with_rest::<4>(-30.0, 6.0);
    loss.mean[3] = 2.8;
    loss.covariance[(3, 3)] = 0.1 * 0.1;
    let ways = [
        ("power, still", drawn::<3, 1, _>(FreePower, power, 0.0)),
        ("exponent", drawn::<4, 2, _>(FreePathLoss, loss, 0.05)),
    ];
    for (name, anees) in ways {
        let mean = anees.average();
        let interval = anees.interval();
        println!("{name}: ANEES {mean:?}");
        assert_eq!(anees.verdict(), Verdict::Consistent, "{name}: {mean:?}, {interval:?}");
    }
}

/// Particles likely under either direction are likely under both in proportion, and so are the
/// means: the posterior is the mixture of the two posteriors, in each particle and so in the cloud.
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
    let mut sum = 0.0;
    let mut centre = Vector3::zeros();
    for (weight, one) in both.hypotheses() {
        let (log, mean) = fused(&one);
        let share = weight * log.exp();
        (sum, centre) = (sum + share, centre + mean * share);
    }
    assert_abs_diff_eq!(evidence, sum.ln(), epsilon = 1e-9);
    assert!((mean - centre / sum).norm() < 1e-6, "{mean} for {}", centre / sum);
}
