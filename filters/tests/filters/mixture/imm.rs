use approx::{abs_diff_eq, assert_abs_diff_eq};
use foxhunt_core::{
    ConstantVelocity, Correction, Estimate, Estimator, EstimatorError, MotionModel, Observation,
    Pose, RandomWalk, State,
    nalgebra::{Matrix1, Matrix2, SMatrix, Vector1, Vector2, Vector4},
    parameter::ParameterError,
};
use foxhunt_filters::{
    Ekf, Gate, GateLimit, Imm, Kalman, ParticleFilter, Reinitialise, Transition,
};
use rand::RngExt;

use super::model::{Part, evidence, normal, on_a_line, rng, white};

fn line(value: f64, variance: f64) -> Observation<1> {
    let value = Vector1::new(value);
    let noise = Matrix1::new(variance);
    Observation::new(0.0, Pose::default(), value, noise).expect("proper")
}

fn chain() -> Transition {
    Transition::per_step(&[&[0.9, 0.1], &[0.3, 0.7]]).expect("stochastic")
}

#[test]
fn one_cycle_is_the_textbooks() {
    // Two modes on a line that differ in their drift: 0.3 and 2 per √s. Bar-Shalom, Li &
    // Kirubarajan 2001, eqs. 11.6.6-8 to -15, by hand.
    let quick = |m, s| on_a_line(m, s).with_motion(RandomWalk::uniform(2.0));
    let models = [(0.4, on_a_line(1.0, 1.0)), (0.6, quick(3.0, 2.0))];
    let mut imm = Imm::new(models, chain()).expect("proper").with_innovation(Kalman::innovation);
    imm.predict(1.0).expect("a proper step");
    let reported = imm.update(&line(2.5, 0.5)).expect("proper");

    let reached = [0.4 * 0.9 + 0.6 * 0.3, 0.4 * 0.1 + 0.6 * 0.7];
    let from = [[0.36 / reached[0], 0.18 / reached[0]], [0.04 / reached[1], 0.42 / reached[1]]];
    let mut joint = [0.0; 2];
    let mut posterior = [(0.0, 0.0); 2];
    let mut innovation = [(0.0, 0.0); 2];
    for j in 0..2 {
        let mean: f64 = from[j][0] + 3.0 * from[j][1];
        let spread =
            from[j][0] * (1.0 + (1.0 - mean).powi(2)) + from[j][1] * (4.0 + (3.0 - mean).powi(2));
        let p = spread + [0.09, 4.0][j];
        joint[j] = reached[j] * normal(2.5, mean, p + 0.5);
        posterior[j] = (mean + p / (p + 0.5) * (2.5 - mean), p * 0.5 / (p + 0.5));
        innovation[j] = (2.5 - mean, p + 0.5);
    }
    let total = joint[0] + joint[1];
    assert_abs_diff_eq!(evidence(reported), total.ln(), epsilon = 1e-12);
    let mean = (joint[0] * posterior[0].0 + joint[1] * posterior[1].0) / total;
    assert_abs_diff_eq!(imm.estimate().mean[0], mean, epsilon = 1e-12);
    let second = |i: usize| posterior[i].1 + (posterior[i].0 - mean).powi(2);
    let variance = (joint[0] * second(0) + joint[1] * second(1)) / total;
    assert_abs_diff_eq!(imm.estimate().covariance[0], variance, epsilon = 1e-12);
    for (reported, j) in imm.probabilities().zip(joint) {
        assert_abs_diff_eq!(reported, j / total, epsilon = 1e-12);
    }
    let y = reached[0] * innovation[0].0 + reached[1] * innovation[1].0;
    let s: f64 =
        (0..2).map(|i| reached[i] * (innovation[i].1 + (innovation[i].0 - y).powi(2))).sum();
    assert_abs_diff_eq!(reported.nis().expect("an innovation"), y * y / s, epsilon = 1e-12);
}

#[test]
fn no_time_mixes_nothing() {
    let mut imm = Imm::new([(0.4, on_a_line(1.0, 1.0)), (0.6, on_a_line(3.0, 2.0))], chain())
        .expect("proper");
    let before: Vec<f64> = imm.probabilities().collect();
    imm.predict(0.0).expect("no step at all");
    assert_eq!(imm.probabilities().collect::<Vec<_>>(), before);
    assert!(imm.models().zip([1.0, 3.0]).all(|(m, mean)| abs_diff_eq!(
        m.estimate().mean[0],
        mean,
        epsilon = 1e-15
    )));
}

type Filter<'a> = Ekf<&'a dyn MotionModel<4>, Part, 4, 2>;

/// Stands and moves, with places observed to 1 m.
fn still_or_moving<'a>(
    motions: [&'a dyn MotionModel<4>; 2],
    prior: &Estimate<4>,
) -> Imm<Filter<'a>, 4, 2> {
    let filter = |motion| (0.5, Ekf::new(motion, Part, *prior).expect("a proper prior"));
    let chain = Transition::sojourn(&[60.0, 60.0]).expect("positive");
    Imm::new(motions.map(filter), chain).expect("proper")
}

/// Forgets its velocity: Ė and Ṅ are damped to nothing.
struct Still;

impl MotionModel<4> for Still {
    fn propagate(&self, state: &State<4>, dt: f64) -> State<4> {
        let left = libm::exp(-dt);
        Vector4::new(state[0], state[1], state[2] * left, state[3] * left)
    }
    fn noise_factor(&self, _: &State<4>, dt: f64) -> SMatrix<f64, 4, 4> {
        SMatrix::from_diagonal(&(Vector4::new(0.05, 0.05, 0.1, 0.1) * libm::sqrt(dt)))
    }
}

#[test]
fn the_probabilities_follow_a_target_that_goes_and_stops() {
    // Seeds 0 to 19: stands for 40 s, goes with 3 m/s for 40 s, stands for 40 s.
    let moving = ConstantVelocity { spectral_density: 0.09 };
    let mut right = 0;
    let mut single = [0.0; 3];
    for seed in 0..20 {
        let mut rng = rng(seed);
        let prior = Estimate::isotropic(Vector4::zeros(), 3.0);
        let mut imm = still_or_moving([&Still, &moving], &prior);
        let mut alone: [Filter<'_>; 2] = [&Still as &dyn MotionModel<4>, &moving]
            .map(|m| Ekf::new(m, Part, prior).expect("proper"));
        let mut truth = Vector2::new(1.0, -1.0);
        for second in 0..120 {
            if (40..80).contains(&second) {
                truth += Vector2::new(3.0 * 0.8, 3.0 * 0.6);
            }
            let value = truth + white::<2>(&mut rng);
            let observed =
                Observation::new(0.0, Pose::default(), value, Matrix2::identity()).expect("proper");
            imm.predict(1.0).expect("a proper step");
            let _ = imm.update(&observed).expect("proper");
            let mut estimates = [imm.estimate(); 3];
            for (filter, estimate) in alone.iter_mut().zip(&mut estimates[1..]) {
                filter.predict(1.0).expect("a proper step");
                let _ = filter.update(&observed).expect("proper");
                *estimate = filter.estimate();
            }
            for (sum, estimate) in single.iter_mut().zip(&estimates) {
                *sum += (estimate.mean.xy() - truth).norm_squared();
            }
            // Ten seconds after each change it has found out.
            let moves = imm.probabilities().nth(1).expect("two modes");
            match second {
                35 | 115 => right += i32::from(moves < 0.3),
                50 | 75 => right += i32::from(moves > 0.9),
                _ => {}
            }
        }
    }
    assert!(right >= 76, "{right} of 80");
    assert!(single[0] < single[1] && single[0] < single[2], "{single:?}");
}

#[test]
fn a_still_target_is_found_to_be_still() {
    // Seed 3: against the moving model alone the error of the last half is smaller.
    let moving = ConstantVelocity { spectral_density: 0.09 };
    let mut both = 0.0;
    let mut one = 0.0;
    let mut rng = rng(3);
    for _ in 0..20 {
        let truth = white::<2>(&mut rng) * 3.0;
        let prior = Estimate::isotropic(Vector4::zeros(), 3.0);
        let mut imm = still_or_moving([&Still, &moving], &prior);
        let mut alone = Ekf::new(moving, Part, prior).expect("proper");
        for second in 0..60 {
            let value = truth + white::<2>(&mut rng);
            let observed =
                Observation::new(0.0, Pose::default(), value, Matrix2::identity()).expect("proper");
            imm.predict(1.0).expect("a proper step");
            alone.predict(1.0).expect("a proper step");
            let _ = imm.update(&observed).expect("proper");
            let _ = alone.update(&observed).expect("proper");
            if second >= 30 {
                both += (imm.estimate().mean.xy() - truth).norm_squared();
                one += (alone.estimate().mean.xy() - truth).norm_squared();
            }
        }
        assert!(imm.probabilities().next() > Some(0.5));
    }
    assert!(both < 0.6 * one, "{both} against {one}");
}

#[test]
fn the_anees_of_a_jumping_target_is_that_of_its_state() {
    // The truth is drawn from the prior, its modes from the chain; 400 runs from seed 0, the NEES
    // after 25 s. A Gaussian of a mixture: 3.3 standard errors, and a tenth for what mixing
    // approximates.
    let motions = [RandomWalk::<1>::uniform(0.1), RandomWalk::uniform(3.0)];
    let mut nees = Vec::new();
    let rows = [[0.95, 0.05], [0.15, 0.85]];
    let chain = Transition::per_step(&[&rows[0], &rows[1]]).expect("stochastic");
    for seed in 0..400 {
        let mut rng = rng(seed);
        let mut mode = usize::from(rng.random::<f64>() < 0.5);
        let mut truth = 4.0 * white::<1>(&mut rng);
        let model = |i: usize| (0.5, on_a_line(0.0, 4.0).with_motion(motions[i]));
        let mut imm = Imm::new([model(0), model(1)], chain.clone()).expect("proper");
        for _ in 0..25 {
            mode = usize::from(rng.random::<f64>() >= rows[mode][0]);
            truth += white::<1>(&mut rng) * motions[mode].drift[0];
            imm.predict(1.0).expect("a proper step");
            let z = truth[0] + white::<1>(&mut rng)[0];
            let _ = imm.update(&line(z, 1.0)).expect("proper");
        }
        nees.push(imm.estimate().nees(&truth).expect("proper"));
    }
    let (mean, error) = super::model::mean_and_error(&nees);
    assert!(abs_diff_eq!(mean, 1.0, epsilon = 0.1 + 3.3 * error), "ANEES {mean:.3} ± {error:.3}");
}

#[test]
fn a_model_that_fails_comes_back_with_the_chain() {
    let broken = on_a_line(3.0, 2.0).with_motion(RandomWalk::uniform(f64::INFINITY));
    let mut imm =
        Imm::new([(0.4, on_a_line(1.0, 1.0)), (0.6, broken.clone())], chain()).expect("proper");
    imm.predict(1.0).expect("one can");
    assert!(
        (imm.estimate().mean[0] - imm.models().next().expect("two").estimate().mean[0]).abs()
            < 1e-12
    );
    assert!(imm.probabilities().nth(1) <= Some(0.0));
    let _ = imm.update(&line(1.0, 1.0)).expect("one can");
    assert!(imm.predict(1.0).is_ok());
    // Where none can, nothing changes.
    let mut lost = Imm::new([(0.4, broken.clone()), (0.6, broken)], chain()).expect("proper");
    let before = lost.estimate();
    assert!(lost.predict(1.0).is_err());
    assert_eq!(lost.estimate(), before);
}

#[test]
fn gates_and_new_beginnings() {
    let gate = Gate::new(GateLimit::Nis(9.0)).expect("positive");
    let models = [1.0, 3.0].map(|m| (0.5, on_a_line(m, 1.0).with_gate(gate)));
    let mut imm = Imm::new(models, chain()).expect("proper");
    let before = imm.estimate();
    let reported = imm.update(&line(90.0, 1.0)).expect("proper");
    assert!(matches!(reported, Correction::Rejected { .. }));
    assert_eq!(imm.estimate(), before);

    let estimate = Estimate::isotropic(Vector1::new(7.0), 0.5);
    imm.reinitialise(&estimate).expect("proper");
    assert!((imm.estimate().mean - estimate.mean).norm() < 1e-12);
    assert!((imm.estimate().covariance - estimate.covariance).norm() < 1e-12);
    let bad = Estimate::isotropic(Vector1::new(f64::NAN), 0.5);
    assert!(imm.reinitialise(&bad).is_err());
    assert!((imm.estimate().mean - estimate.mean).norm() < 1e-12);
}

#[test]
fn a_chain_of_another_size_is_refused() {
    let refused = Imm::new([(1.0, on_a_line(1.0, 1.0))], chain()).err();
    assert!(matches!(
        refused,
        Some(EstimatorError::Parameter(ParameterError { name: "modes of the chain", .. }))
    ));
}

#[test]
fn models_may_be_clouds() {
    // The same cycle of ten steps by Kalman filters, which are exact here, and by clouds.
    let walks = [RandomWalk::uniform(0.3), RandomWalk::uniform(2.0)];
    let prior = Estimate::isotropic(Vector1::new(1.0), 1.5);
    let exact = walks.map(|walk| (0.5, on_a_line(1.0, 1.5).with_motion(walk)));
    let clouds = walks.map(|walk| {
        let cloud = ParticleFilter::new(walk, Part, prior, 20_000, rng(3));
        (0.5, cloud.expect("a proper prior"))
    });
    let mut exact = Imm::<_, 1, 1>::new(exact, chain()).expect("proper");
    let mut clouds = Imm::<_, 1, 1>::new(clouds, chain()).expect("proper");
    for step in 0..10_u8 {
        let z = line(f64::from(step), 0.5);
        exact.predict(1.0).expect("a proper step");
        clouds.predict(1.0).expect("a proper step");
        let [known, reported] = [exact.update(&z), clouds.update(&z)]
            .map(|correction| evidence(correction.expect("proper")));
        assert!((known - reported).abs() < 0.1, "step {step}: evidence {reported}, not {known}");
        let away = exact.estimate().mean[0] - clouds.estimate().mean[0];
        assert!(abs_diff_eq!(away, 0.0, epsilon = 0.05), "step {step}: off by {away}");
    }
    for (known, reported) in exact.probabilities().zip(clouds.probabilities()) {
        assert_abs_diff_eq!(known, reported, epsilon = 0.03);
    }
    let flat = Estimate::isotropic(Vector1::zeros(), 0.0);
    let mut cloud: ParticleFilter<_, _, _, 1, 1> =
        ParticleFilter::new(walks[0], Part, prior, 100, rng(3)).expect("proper");
    let before = cloud.estimate();
    assert!(cloud.reinitialise(&flat).is_err() && cloud.estimate() == before);
}
