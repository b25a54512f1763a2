//! Edges of what filters take, and runs that no flight would bring.

use approx::assert_abs_diff_eq;
use foxhunt_core::{
    Axis, ConstantVelocity, Correction, Estimate, Estimator, MeasurementModel, Pose, Quantity,
    RandomWalk, State,
    nalgebra::{Matrix2, Vector2, Vector4},
};
use foxhunt_filters::{Ckf, Ekf, Gate, Iterations, ParticleFilter, Resampling, Ukf, Unscented};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use super::model::{FIELD, observed};

const PROPER: &str = "a proper prior";

/// The reference's model of a target that moves.
struct Planar;

impl MeasurementModel<4, 2> for Planar {
    fn quantities(&self) -> [Quantity; 2] {
        FIELD.quantities()
    }
    fn expected(&self, state: &State<4>, receiver: &Pose) -> Vector2<f64> {
        FIELD.expected(&state.fixed_rows::<2>(0).into_owned(), receiver)
    }
}

pub(super) fn rng(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

/// Every estimator from one prior.
fn all(prior: Estimate<2>) -> [(&'static str, Box<dyn Estimator<2, 2>>); 8] {
    let ten = Iterations::at_most(10).expect("at least one");
    let still = RandomWalk::uniform(0.1957);
    let proper = "a proper prior";
    [
        ("EKF", Box::new(Ekf::new(still, FIELD, prior).expect(proper))),
        ("UKF", Box::new(Ukf::new(still, FIELD, prior).expect(proper))),
        ("CKF", Box::new(Ckf::new(still, FIELD, prior).expect(proper))),
        (
            "iterated EKF",
            Box::new(Ekf::new(still, FIELD, prior).expect(proper).with_iterations(ten)),
        ),
        (
            "iterated CKF",
            Box::new(Ckf::new(still, FIELD, prior).expect(proper).with_iterations(ten)),
        ),
        ("EKF of the reference", Box::new(Ekf::pritzl2018(FIELD, prior).expect(proper))),
        ("UKF of the reference", Box::new(Ukf::pritzl2018(FIELD, prior).expect(proper))),
        (
            "particles",
            Box::new(ParticleFilter::new(still, FIELD, prior, 20_000, rng(7)).expect(proper)),
        ),
    ]
}

#[test]
fn a_bearing_across_the_cut_moves_the_belief_a_little() {
    // The prior mean lies at π − 0.005, the bearing is −π + 0.02: 0.025 rad on. Lateral gain
    // 100 / (100 + 25): by hand −0.8 · 2.5 m to the side, and a little back as the line turns.
    let prior = Estimate::isotropic(Vector2::new(-100.0, 0.5), 10.0);
    let z = Vector2::new(-80.0, -core::f64::consts::PI + 0.02);
    let bearing = observed(Pose::default(), z, 1.0, 0.05).without(0);
    for (name, mut estimator) in all(prior) {
        assert!(matches!(estimator.update(&bearing), Ok(Correction::Fused { .. })), "{name}");
        let Estimate { mean, covariance } = estimator.estimate();
        // The linear filters stay on their linearisation; the cloud's own error is 10 m / √10⁴.
        assert!((mean - Vector2::new(-100.4, -1.5)).amax() < 0.6, "{name}: {mean}");
        assert!((covariance[(1, 1)].sqrt() - 4.47).abs() < 0.3, "{name}: {covariance}");
    }
}

#[test]
fn a_receiver_on_the_prior_mean_learns_from_the_power_alone() {
    let prior = Estimate::isotropic(Vector2::new(5.0, -2.0), 8.0);
    for up in [0.0, 4.0] {
        let overhead = Pose::at(5.0, -2.0, up);
        for (name, mut estimator) in all(prior) {
            for step in 0..20_u8 {
                let z = Vector2::new(-60.0, f64::from(step) * 0.5 - 3.0);
                let observed = observed(overhead, z, 4.0, 0.5);
                estimator.predict(1.0).expect("a proper step");
                let _ = estimator.update(&observed).unwrap_or_else(|e| panic!("{name}: {e}"));
                let Estimate { mean, covariance } = estimator.estimate();
                assert!(mean.iter().all(|m| m.is_finite()), "{name}, {up} m up: {mean}");
                assert!(covariance.cholesky().is_some(), "{name}, {up} m up: {covariance}");
            }
        }
    }
}

#[test]
fn a_state_with_an_angle_stays_on_the_circle() {
    /// A target on a unit circle that is measured as such.
    struct Turn;
    impl foxhunt_core::MotionModel<2> for Turn {
        fn propagate(&self, state: &State<2>, dt: f64) -> State<2> {
            state + Vector2::new(0.0, 0.3) * dt
        }
        fn noise_factor(&self, _state: &State<2>, dt: f64) -> Matrix2<f64> {
            Matrix2::from_diagonal_element(0.05 * dt.sqrt())
        }
        fn axes(&self) -> [Axis; 2] {
            [Axis::Linear, Axis::Angle]
        }
    }
    struct Itself;
    impl MeasurementModel<2, 2> for Itself {
        fn quantities(&self) -> [Quantity; 2] {
            [Quantity::linear("x_m"), Quantity::angle("heading_rad")]
        }
        fn expected(&self, state: &State<2>, _receiver: &Pose) -> Vector2<f64> {
            *state
        }
    }
    let prior = Estimate::isotropic(Vector2::new(0.0, 3.0), 0.2);
    let particles = ParticleFilter::new(Turn, Itself, prior, 4000, rng(3));
    let mut filters: [(&str, Box<dyn Estimator<2, 2>>); 3] = [
        ("EKF", Box::new(Ekf::new(Turn, Itself, prior).expect("a proper prior"))),
        ("UKF", Box::new(Ukf::new(Turn, Itself, prior).expect("a proper prior"))),
        ("particles", Box::new(particles.expect("a proper prior"))),
    ];
    for (name, filter) in &mut filters {
        let mut truth = 3.0;
        for _ in 0..30 {
            truth = foxhunt_core::angle::wrap(truth + 0.3);
            filter.predict(1.0).expect("a proper step");
            let z = observed(Pose::default(), Vector2::new(0.0, truth), 0.1, 0.1);
            let _ = filter.update(&z).expect("possible");
            let angle = filter.estimate().mean[1];
            // σ settles near 0.05; the cloud adds a few hundredths of that.
            assert!(foxhunt_core::angle::distance(angle, truth) < 0.1, "{name}: {angle}, {truth}");
            assert!((-core::f64::consts::PI..core::f64::consts::PI).contains(&angle), "{name}");
        }
    }
    // The last of them is the cloud, which goes round as its mean does.
    let [.., (_, cloud)] = &filters;
    cloud.visit_samples(&mut |state, _| assert!(state[1].abs() <= core::f64::consts::PI));
}

#[test]
fn a_rejected_observation_leaves_the_prediction() {
    let prior = Estimate::isotropic(Vector2::new(30.0, 0.0), 2.0);
    let gate = Gate::probability(0.99).expect("in range");
    let mut ekf = Ekf::new(RandomWalk::uniform(0.5), FIELD, prior).expect("proper").with_gate(gate);
    ekf.predict(1.0).expect("a proper step");
    let predicted = ekf.estimate();
    let wild = observed(Pose::at(0.0, 0.0, 4.0), Vector2::new(-70.0, 2.0), 4.0, 0.1);
    let reported = ekf.update(&wild).expect("a proper observation");
    let innovation = ekf.innovation(&wild).expect("a finite model");
    assert_eq!(reported, Correction::Rejected { nis: innovation.nis, limit: gate.limit(2) });
    assert_eq!(ekf.estimate(), predicted);
}

#[test]
fn one_seed_is_one_run_and_stays_it() {
    let run = |seed, scheme| {
        let prior = Estimate::isotropic(Vector4::new(20.0, 10.0, 0.5, 0.0), 5.0);
        let motion = ConstantVelocity { spectral_density: 0.01 };
        let mut filter = ParticleFilter::new(motion, Planar, prior, 500, rng(seed))
            .expect("a proper prior")
            .with_resampling(scheme);
        for step in 0..6_u8 {
            filter.predict(1.0).expect("a proper step");
            let receiver = Pose::at(3.0 * f64::from(step), 0.0, 4.0);
            let _ = filter.update(&observed(receiver, Vector2::new(-66.0, 0.5), 4.0, 0.2));
        }
        filter.estimate()
    };
    let first = run(1, Resampling::Systematic);
    assert_eq!(first, run(1, Resampling::Systematic));
    assert_ne!(first, run(2, Resampling::Systematic));
    // To the digits that another processor's libm may not change: the rest is rounding.
    let pinned = |estimate: Estimate<4>, east: f64, north: f64| {
        let error = (estimate.mean.fixed_rows::<2>(0) - Vector2::new(east, north)).norm();
        assert!(error < 1e-9, "the stream has changed: off by {error}: {:?}", estimate.mean);
    };
    pinned(first, 34.434_305_134_577_3, 11.432_969_110_002_198);
    pinned(run(1, Resampling::Multinomial), 32.765_493_462_758_634, 10.519_145_530_858_358);
}

#[test]
fn a_collapsed_cloud_keeps_a_covariance_and_reports_it() {
    // A bearing that 100 particles cannot resolve: the best of them has all the weight.
    let prior = Estimate::isotropic(Vector2::new(40.0, 0.0), 20.0);
    let make = || {
        ParticleFilter::new(RandomWalk::uniform(0.0), FIELD, prior, 100, rng(1))
            .and_then(|filter| filter.with_progressive_correction(0.0))
            .expect("a proper prior")
    };
    let mut filter = make();
    let z = observed(Pose::at(0.0, 0.0, 4.0), Vector2::new(-73.0, 1.2), 1.0, 1e-4);
    for _ in 0..50 {
        filter.predict(1.0).expect("a proper step");
        let reported = filter.update(&z).expect("possible");
        let Correction::Fused { effective_sample_size: Some(size), .. } = reported else {
            panic!("not fused: {reported:?}");
        };
        assert!((1.0..100.1).contains(&size));
        assert!(filter.estimate().covariance.cholesky().is_some());
    }
    let mut fresh = make();
    assert!(matches!(fresh.update(&z), Ok(Correction::Fused { .. })));
    let size = fresh.effective_sample_size();
    assert!(size < 1.001, "{size} effective particles: no collapse");
    // All that is left is a hundredth of the prior's variance, 20 m / 10.
    let sigma = fresh.estimate().covariance[(0, 0)].sqrt();
    assert!((1.5..2.5).contains(&sigma), "σ {sigma} m");
}

#[test]
fn the_nis_of_a_cloud_is_that_of_its_moments() {
    // Around the drone, where the mean of what is expected is far from what the mean expects.
    let prior = Estimate::isotropic(Vector2::new(3.0, 1.0), 8.0);
    let mut filter = ParticleFilter::new(RandomWalk::uniform(0.1), FIELD, prior, 500, rng(2))
        .expect("a proper prior");
    let receiver = Pose::at(2.0, 2.0, 4.0);
    for rss_dbm in [-50.0, -60.0] {
        let mut mean = 0.0;
        let mut square = 0.0;
        filter.visit_samples(&mut |x, w| {
            let expected = FIELD.expected(x, &receiver)[0];
            mean += w * expected;
            square += w * expected * expected;
        });
        let nis = (rss_dbm - mean).powi(2) / (square - mean * mean + 16.0);
        let power = observed(receiver, Vector2::new(rss_dbm, 0.0), 4.0, 1.0).without(1);
        let reported = filter.update(&power).expect("possible").nis().expect("reported");
        assert_abs_diff_eq!(reported, nis, epsilon = 1e-9 * (1.0 + nis));
    }
}

/// Runs of 30 observations that no flight would bring; seed `i` for run `i`.
fn survives<E: Estimator<2, 2>>(
    name: &str,
    runs: u64,
    make: impl Fn(RandomWalk<2>, Estimate<2>, u64) -> E,
) {
    for run in 0..runs {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(run);
        // From centimetres to kilometres.
        let mut size = |low: f64, high: f64| 10.0_f64.powf(rng.random_range(low..high));
        let sigma = size(-2.0, 3.0);
        let far = size(-1.0, 3.7);
        let drift = size(-3.0, 1.0);
        let scale = [size(-1.0, 3.0), size(-3.0, 1.0)];
        let start = Vector2::new(far, -0.3 * far);
        let mut filter = make(RandomWalk::uniform(drift), Estimate::isotropic(start, sigma), run);
        for step in 0..30 {
            filter.predict(1.0).unwrap_or_else(|e| panic!("{name}, run {run}, step {step}: {e}"));
            let believed = filter.estimate().mean;
            let receiver = match rng.random_range(0..5_u8) {
                // On the belief, on the ground and above it; on the prior; beside it; far off.
                0 => Pose::at(believed.x, believed.y, 0.0),
                1 => Pose::at(believed.x, believed.y, 4.0),
                2 => Pose::at(start.x, start.y, 4.0),
                3 => Pose::at(believed.x + 1e-9, believed.y, 1.0),
                _ => Pose::at(rng.random_range(-1e4..1e4), rng.random_range(-1e4..1e4), 30.0),
            };
            let pi = std::f64::consts::PI;
            let bearing = match rng.random_range(0..4_u8) {
                0 => pi,
                1 => -pi,
                2 => pi - 1e-12,
                _ => rng.random_range(-pi..pi),
            };
            let z = Vector2::new(rng.random_range(-140.0..20.0), bearing);
            let whole = observed(receiver, z, scale[0], scale[1]);
            let observed = match rng.random_range(0..4_u8) {
                0 => whole.without(0),
                1 => whole.without(1),
                _ => whole,
            };
            let reported = filter.update(&observed);
            assert!(reported.is_ok(), "{name}, run {run}, step {step}: {reported:?}");
            let Estimate { mean, covariance } = filter.estimate();
            assert!(mean.iter().all(|m| m.is_finite()), "{name}, run {run}, step {step}: {mean}");
            assert!(
                covariance.cholesky().is_some(),
                "{name}, run {run}, step {step}: {covariance}"
            );
            assert!((covariance - covariance.transpose()).norm() <= 0.0);
        }
    }
}

#[test]
fn nothing_makes_a_gaussian_indefinite() {
    survives("EKF", 500, |f, prior, _| Ekf::new(f, FIELD, prior).expect(PROPER));
    survives("UKF", 500, |f, prior, _| Ukf::new(f, FIELD, prior).expect(PROPER));
    let ten = Iterations::at_most(10).expect("at least one");
    survives("iterated EKF", 500, |f, prior, _| {
        Ekf::new(f, FIELD, prior).expect(PROPER).with_iterations(ten)
    });
    survives("iterated CKF", 500, |f, prior, _| {
        Ckf::new(f, FIELD, prior).expect(PROPER).with_iterations(ten)
    });
    survives("UKF of the reference", 500, |f, prior, _| {
        Ukf::pritzl2018(FIELD, prior).expect(PROPER).with_motion(f)
    });
    survives("UKF without its gate", 500, |f, prior, _| {
        let thin = Unscented::pritzl2018();
        Ukf::new(f, FIELD, prior).and_then(|ukf| ukf.with_transform(thin)).expect(PROPER)
    });
}

#[test]
fn nothing_makes_a_cloud_indefinite() {
    survives("particles", 200, |f, prior, seed| {
        let rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        ParticleFilter::new(f, FIELD, prior, 200, rng).expect(PROPER)
    });
}
