use approx::{abs_diff_eq, assert_abs_diff_eq};
use foxhunt_core::{
    ConstantVelocity, Correction, Estimate, Estimator, MeasurementModel, MotionModel, Observation,
    Pose, Quantity, RandomWalk, State,
    nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector2, Vector4},
};
use foxhunt_filters::{Ckf, Ekf, Iterations, Kalman, ParticleFilter, Transform, Ukf, Unscented};
use proptest::prelude::*;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use super::{
    model::{FIELD, observed},
    textbook::{self, Posterior},
};

/// z = H x, two numbers of the four of (E, N, Ė, Ṅ).
#[derive(Clone, Copy, Debug)]
struct Linear(Matrix2x4<f64>);

impl MeasurementModel<4, 2> for Linear {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::linear("east_m"), Quantity::linear("north_m")]
    }
    fn expected(&self, state: &State<4>, _receiver: &Pose) -> Vector2<f64> {
        self.0 * state
    }
    fn jacobian(&self, _state: &State<4>, _receiver: &Pose) -> Matrix2x4<f64> {
        self.0
    }
}

const MOTION: ConstantVelocity = ConstantVelocity { spectral_density: 0.09 };

/// A positive definite matrix out of any numbers.
fn proper<const D: usize>(numbers: &[f64]) -> foxhunt_core::Covariance<D> {
    let root = foxhunt_core::Covariance::<D>::from_fn(|i, j| numbers[i * D + j]);
    root * root.transpose() + foxhunt_core::Covariance::identity() * 0.1
}

fn numbers<const K: usize>(size: f64) -> impl Strategy<Value = [f64; K]> {
    proptest::array::uniform(-size..size)
}

/// A prior, a model and three observations of which some numbers are missing.
fn problem() -> impl Strategy<Value = (Estimate<4>, Linear, Vec<Observation<2>>)> {
    let observation =
        (numbers::<2>(20.0), numbers::<4>(2.0), 0..3_usize).prop_map(|(z, r, lost)| {
            let whole = Observation::new(0.0, Pose::default(), Vector2::from(z), proper(&r));
            let whole = whole.expect("finite and positive definite");
            if lost < 2 { whole.without(lost) } else { whole }
        });
    let prior = (numbers::<4>(10.0), numbers::<16>(2.0))
        .prop_map(|(mean, root)| Estimate { mean: Vector4::from(mean), covariance: proper(&root) });
    let model = numbers::<8>(2.0).prop_map(|h| Linear(Matrix2x4::from_row_slice(&h)));
    (prior, model, proptest::collection::vec(observation, 3))
}

/// Every filter against the textbook over one predict and three updates after it.
fn follows<T: Transform>(
    mut filter: Kalman<T, ConstantVelocity, Linear, 4, 2>,
    prior: &Estimate<4>,
    observations: &[Observation<2>],
    model: &Linear,
) {
    let dt = 0.7;
    let here = State::zeros();
    let l: Matrix4<f64> = MOTION.noise_factor(&here, dt);
    let mut belief = textbook::predict(prior, &MOTION.jacobian(&here, dt), &(l * l.transpose()));
    filter.predict(dt).expect("a proper step");
    for observation in observations {
        let Posterior { estimate, nis, log_evidence } =
            textbook::extended(&belief, model, observation);
        let reported = filter.update(observation).expect("a proper observation");
        let Correction::Fused { nis: Some(actual_nis), log_evidence: actual, .. } = reported else {
            panic!("an open gate rejects nothing: {reported:?}");
        };
        // Rounding, times the condition of P and S: some 10³ here.
        assert_abs_diff_eq!(actual_nis, nis, epsilon = 1e-8 * (1.0 + nis));
        assert!(abs_diff_eq!(actual, log_evidence, epsilon = 1e-8 * (1.0 + nis)), "evidence off");
        let error = (filter.estimate().mean - estimate.mean).norm();
        assert!(error < 1e-8 * (1.0 + estimate.mean.norm()), "mean off by {error}");
        let error = (filter.estimate().covariance - estimate.covariance).norm();
        assert!(error < 1e-9 * belief.covariance.norm(), "covariance off by {error}");
        belief = estimate;
    }
}

proptest! {
    #[test]
    fn on_linear_models_ekf_and_ukf_are_the_kalman_filter((prior, model, observed) in problem()) {
        let ekf = Ekf::new(MOTION, model, prior).expect("a proper prior");
        follows(ekf, &prior, &observed, &model);
        let ukf = Ukf::new(MOTION, model, prior).expect("a proper prior");
        follows(ukf.clone(), &prior, &observed, &model);
        let other = Unscented::new(0.3, 0.5, 1.0).expect("in range");
        follows(ukf.clone().with_transform(other).expect("n + κ = 5"), &prior, &observed, &model);
        let ckf = Ckf::new(MOTION, model, prior).expect("a proper prior");
        follows(ckf, &prior, &observed, &model);
        for max in [1, 2, 7] {
            let iterations = Iterations::at_most(max).and_then(|i| i.with_tolerance(0.0));
            let iterations = iterations.expect("in range");
            let ekf = Ekf::new(MOTION, model, prior).expect("a proper prior");
            follows(ekf.with_iterations(iterations), &prior, &observed, &model);
            follows(ukf.clone().with_iterations(iterations), &prior, &observed, &model);
        }
    }

    #[test]
    fn the_order_of_updates_after_one_predict_is_free((prior, model, observed) in problem()) {
        let after = |order: [usize; 3]| {
            let mut ukf = Ukf::new(MOTION, model, prior).expect("a proper prior");
            ukf.predict(0.7).expect("a proper step");
            let mut log_evidence = 0.0;
            for i in order {
                if let Correction::Fused { log_evidence: reported, .. } =
                    ukf.update(&observed[i]).expect("a proper observation")
                {
                    log_evidence += reported;
                }
            }
            (ukf.estimate(), log_evidence)
        };
        let (straight, evidence) = after([0, 1, 2]);
        for order in [[2, 1, 0], [1, 2, 0]] {
            let (turned, other) = after(order);
            let mean = (turned.mean - straight.mean).norm();
            prop_assert!(mean < 1e-8 * (1.0 + straight.mean.norm()));
            let covariance = (turned.covariance - straight.covariance).norm();
            prop_assert!(covariance < 1e-9 * prior.covariance.norm());
            prop_assert!((other - evidence).abs() < 1e-7 * (1.0 + evidence.abs()));
        }
    }

    #[test]
    fn the_ukf_is_the_weighted_sums_of_the_textbook(
        east in -30.0..30.0_f64, north in -30.0..30.0_f64, root in numbers::<4>(4.0),
        rss in -80.0..-40.0, bearing in -4.0..4.0, lost in 0..3_usize,
        alpha in 0.3..1.0, beta in 0.0..3.0, kappa in 0.0..2.0,
    ) {
        let prior = Estimate { mean: Vector2::new(east, north), covariance: proper(&root) };
        let whole = observed(Pose::at(3.0, -7.0, 4.0), Vector2::new(rss, bearing), 4.0, 0.4);
        let observation = if lost < 2 { whole.without(lost) } else { whole };
        let reported = textbook::unscented(&prior, &FIELD, &observation, (alpha, beta, kappa));
        let transform = Unscented::new(alpha, beta, kappa).expect("in range");
        let mut ukf: Ukf<_, _, 2, 2> =
            Kalman::<Unscented, _, _, 2, 2>::new(RandomWalk::uniform(0.0), FIELD, prior)
                .and_then(|ukf| ukf.with_transform(transform))
                .expect("a proper prior and transform");
        let nis = ukf.update(&observation).expect("a proper observation").nis().expect("reported");
        prop_assert!((nis - reported.nis).abs() < 1e-8 * (1.0 + nis));
        let estimate = ukf.estimate();
        prop_assert!((estimate.mean - reported.estimate.mean).norm() < 1e-8);
        let error: Matrix2<f64> = estimate.covariance - reported.estimate.covariance;
        prop_assert!(error.norm() < 1e-9 * prior.covariance.norm());
    }
}

#[test]
fn particles_agree_with_the_kalman_filter_on_a_linear_model() {
    // Seed 4, 40 000 particles, three steps. The particle mean's error is about √(P / ESS), that
    // of a variance √(2 / ESS) of it; five of each, so a false alarm comes once in 10⁵ runs. The
    // error of the log-evidence adds √(1 / ESS) a step.
    let model = Linear(Matrix2x4::new(1.0, 0.2, 0.0, 0.0, 0.0, 1.0, 0.5, 0.0));
    let prior = Estimate::isotropic(Vector4::new(2.0, -1.0, 0.3, 0.1), 1.0);
    let mut kalman = Ekf::new(MOTION, model, prior).expect("a proper prior");
    let rng = Xoshiro256PlusPlus::seed_from_u64(4);
    let mut particles =
        ParticleFilter::new(MOTION, model, prior, 40_000, rng).expect("a proper prior");
    let mut exact = 0.0;
    let mut sampled = 0.0;
    for z in [Vector2::new(3.0, -1.5), Vector2::new(2.1, 0.2), Vector2::new(1.0, -1.0)] {
        let noise = Matrix2::new(0.6, 0.2, 0.2, 0.5);
        let observation = Observation::new(0.0, Pose::default(), z, noise).expect("proper");
        kalman.predict(0.7).expect("a proper step");
        particles.predict(0.7).expect("a proper step");
        let reported = [kalman.update(&observation), particles.update(&observation)];
        let [
            Ok(Correction::Fused { nis: Some(nis), log_evidence, .. }),
            Ok(Correction::Fused {
                nis: Some(cloud_nis),
                log_evidence: cloud_evidence,
                effective_sample_size: Some(size),
            }),
        ] = reported
        else {
            panic!("not fused: {reported:?}");
        };
        exact += log_evidence;
        sampled += cloud_evidence;
        let least = 5.0 / size.sqrt();
        assert_abs_diff_eq!(cloud_nis / nis, 1.0, epsilon = 2.0 * least);
        let belief = kalman.estimate();
        let cloud = particles.estimate();
        let root = belief.covariance.cholesky().expect("positive definite").unpack();
        let white = root.solve_lower_triangular(&(cloud.mean - belief.mean)).expect("proper");
        assert!(white.amax() < 2.0 * least, "mean off by {white}");
        let error = (cloud.covariance - belief.covariance).norm() / belief.covariance.norm();
        assert!(error < 2.0 * least, "covariance off by {error}");
        assert_abs_diff_eq!(exact, sampled, epsilon = 3.0 * least);
    }
}

#[test]
fn evidence_does_not_depend_on_when_the_cloud_is_resampled() {
    // Seed 5, 20 000 particles; always, adaptively, never. Their evidences differ by Monte-Carlo
    // noise only, 8 steps of about √(1 / ESS): 0.05 is five of them.
    let model = Linear(Matrix2x4::new(1.0, 0.2, 0.0, 0.0, 0.0, 1.0, 0.5, 0.0));
    let prior = Estimate::isotropic(Vector4::zeros(), 1.0);
    let evidence = |threshold: f64| {
        let rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let mut filter = ParticleFilter::new(MOTION, model, prior, 20_000, rng)
            .and_then(|filter| filter.with_resampling_threshold(threshold))
            .expect("a proper prior");
        let mut total = 0.0;
        let mut smallest = f64::INFINITY;
        for step in 0..8 {
            let z = Vector2::new(0.3 * f64::from(step % 3), -0.4);
            let noise = Matrix2::new(1.0, 0.2, 0.2, 1.0);
            let observation = Observation::new(0.0, Pose::default(), z, noise).expect("proper");
            filter.predict(0.2).expect("a proper step");
            let reported = filter.update(&observation).expect("possible");
            let Correction::Fused { log_evidence, effective_sample_size: Some(size), .. } =
                reported
            else {
                panic!("not fused: {reported:?}");
            };
            total += log_evidence;
            smallest = size.min(smallest);
        }
        (total, smallest)
    };
    let ((always, _), (adaptive, resampled), (never, left)) =
        (evidence(1.0), evidence(0.5), evidence(0.0));
    assert!(left < 0.5 * resampled, "{left} effective particles: nothing was tested");
    assert_abs_diff_eq!(adaptive, never, epsilon = 0.05);
    assert_abs_diff_eq!(always, never, epsilon = 0.05);
}
