use approx::{abs_diff_eq, assert_abs_diff_eq};
use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, MeasurementModel, Observation, Pose, Quantity,
    RandomWalk, Role, State,
    nalgebra::{Matrix1, Vector1, Vector2},
};
use foxhunt_filters::{Bank, Ekf, Gate, GateLimit, ParticleFilter};

use super::model::{Part, evidence, normal, on_a_line, rng};

fn line(value: f64, variance: f64) -> Observation<1> {
    let value = Vector1::new(value);
    let noise = Matrix1::new(variance);
    Observation::new(0.0, Pose::default(), value, noise).expect("proper")
}

#[test]
fn two_hypotheses_on_a_line_are_exact() {
    // Weights ¼ and ¾, means −2 and 3, σ 1 and 2; drift 0.3 for 2 s; then z = 0.5, σ² = 0.7.
    let mut bank = Bank::new([(1.0, on_a_line(-2.0, 1.0)), (3.0, on_a_line(3.0, 2.0))])
        .expect("proper")
        .with_innovation(Ekf::innovation);
    bank.predict(2.0).expect("a proper step");
    let reported = bank.update(&line(0.5, 0.7)).expect("proper");
    let prior = [(0.25, -2.0, 1.0 + 0.18), (0.75, 3.0, 4.0 + 0.18)];
    let joint = prior.map(|(w, m, p)| w * normal(0.5, m, p + 0.7));
    let total = joint[0] + joint[1];
    assert_abs_diff_eq!(evidence(reported), total.ln(), epsilon = 1e-12);
    let posterior = prior.map(|(_, m, p)| (m + p / (p + 0.7) * (0.5 - m), p * 0.7 / (p + 0.7)));
    let mean = (joint[0] * posterior[0].0 + joint[1] * posterior[1].0) / total;
    let second = |i: usize| posterior[i].1 + (posterior[i].0 - mean).powi(2);
    let variance = (joint[0] * second(0) + joint[1] * second(1)) / total;
    let estimate = bank.estimate();
    assert_abs_diff_eq!(estimate.mean[0], mean, epsilon = 1e-12);
    assert_abs_diff_eq!(estimate.covariance[0], variance, epsilon = 1e-12);
    let weights: Vec<f64> = bank.components().map(|(w, _)| w).collect();
    assert_abs_diff_eq!(weights[0], joint[0] / total, epsilon = 1e-12);
    // The innovation of the mixture: mean 0.5 − 1.75, variance of the parts and between them.
    let spread = 0.25 * 1.88 + 0.75 * 4.88 + 0.25 * 0.75 * 25.0;
    let nis = reported.nis().expect("an innovation");
    assert_abs_diff_eq!(nis, 1.25 * 1.25 / spread, epsilon = 1e-12);
}

#[test]
fn evidence_over_many_steps_is_that_of_the_joint_density() {
    // p(z₁ … z₈) = Σ wᵢ N(z; mᵢ 1, σᵢ² 1 1ᵀ + R I): no recursion, brute force by integration.
    let values = [0.4, 1.1, -0.3, 0.9, 1.6, 0.2, 0.8, 0.5];
    let still = |mean, sigma| on_a_line(mean, sigma).with_motion(RandomWalk::uniform(0.0));
    let mut bank =
        Bank::new([(0.5, still(-1.0, 0.5)), (0.3, still(2.0, 1.5)), (0.2, still(0.0, 3.0))])
            .expect("proper")
            .with_pruning(0.0)
            .expect("in range");
    let mut reported = 0.0;
    for value in values {
        bank.predict(1.0).expect("a proper step");
        reported += evidence(bank.update(&line(value, 0.5)).expect("proper"));
    }
    let step = 1e-3;
    let mut integral = 0.0;
    for i in -20_000..20_000 {
        let x = f64::from(i) * step;
        let prior =
            0.5 * normal(x, -1.0, 0.25) + 0.3 * normal(x, 2.0, 2.25) + 0.2 * normal(x, 0.0, 9.0);
        integral += prior * values.iter().map(|z| normal(*z, x, 0.5)).product::<f64>() * step;
    }
    assert_abs_diff_eq!(reported, integral.ln(), epsilon = 1e-9);
}

#[test]
fn a_light_component_is_dropped_and_an_impossible_one_never_counts() {
    let bank = || {
        Bank::new([
            (1.0, on_a_line(0.0, 1.0)),
            (1.0, on_a_line(50.0, 1.0)),
            (0.0, on_a_line(0.0, 1.0)),
        ])
    };
    let mut pruned = bank().expect("proper");
    assert_abs_diff_eq!(pruned.estimate().mean[0], 25.0, epsilon = 1e-12);
    let _ = pruned.update(&line(0.0, 1.0)).expect("proper");
    assert_eq!(pruned.len(), 1);
    assert!(pruned.components().all(|(w, _)| abs_diff_eq!(w, 1.0, epsilon = 1e-15)));
    let mut kept = bank().and_then(|bank| bank.with_pruning(0.0)).expect("proper");
    let _ = kept.update(&line(0.0, 1.0)).expect("proper");
    assert_eq!(kept.len(), 2);
}

#[test]
fn a_gate_inside_keeps_the_belief_and_loses_the_weight() {
    let gate = Gate::new(GateLimit::Nis(9.0)).expect("positive");
    let bank = |near: f64| {
        let parts = [near, 10.0].map(|m| (0.5, on_a_line(m, 1.0).with_gate(gate)));
        Bank::new(parts).and_then(|bank| bank.with_pruning(0.0)).expect("proper")
    };
    let mut some = bank(0.0);
    let reported = some.update(&line(0.0, 1.0)).expect("proper");
    // Both components have the same S, so the weight is the one that no gate would have left.
    let [near, far] = [0.0, 10.0].map(|m| 0.5 * normal(0.0, m, 2.0));
    assert_abs_diff_eq!(evidence(reported), (near + far).ln(), epsilon = 1e-12);
    let reported: Vec<_> = some.components().map(|(w, e)| (w, e.estimate().mean[0])).collect();
    assert!((reported[1].0 / (far / (near + far)) - 1.0).abs() < 1e-9 && reported[1].1 >= 10.0);
    // Where all keep it out, so does the bank, and no weight changes.
    let mut none = bank(11.0);
    let before = none.estimate();
    let reported = none.update(&line(0.0, 1.0)).expect("proper");
    assert!(matches!(reported, Correction::Rejected { limit, .. } if (limit - 9.0).abs() < 1e-12));
    assert_eq!(none.estimate(), before);
}

/// Fails where the state is above 5.
#[derive(Clone, Debug)]
struct Brittle;

impl MeasurementModel<1, 1> for Brittle {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::linear("x_m")]
    }
    fn expected(&self, state: &State<1>, _: &Pose) -> Vector1<f64> {
        if state[0] > 5.0 { Vector1::new(f64::NAN) } else { *state }
    }
}

#[test]
fn one_that_fails_is_dropped_and_all_that_fail_change_nothing() {
    let part = |mean: f64| {
        let prior = Estimate::isotropic(Vector1::new(mean), 1.0);
        (0.5, Ekf::new(RandomWalk::uniform(0.1), Brittle, prior).expect("a proper prior"))
    };
    let mut half = Bank::new([part(0.0), part(9.0)]).expect("proper");
    let reported = half.update(&line(0.5, 1.0)).expect("one can");
    assert_abs_diff_eq!(evidence(reported), (0.5 * normal(0.5, 0.0, 2.0)).ln(), epsilon = 1e-12);
    assert_eq!(half.len(), 1);
    let mut none = Bank::new([part(8.0), part(9.0)]).expect("proper");
    let before = (none.estimate(), none.components().map(|(w, _)| w).collect::<Vec<_>>());
    let error = EstimatorError::NotFinite { role: Role::Expected };
    assert_eq!(none.update(&line(0.5, 1.0)), Err(error));
    assert_eq!((none.estimate(), none.components().map(|(w, _)| w).collect()), before);
    // And a step that no component takes.
    let steep = |mean: f64| (0.5, part(mean).1.with_motion(RandomWalk::uniform(f64::INFINITY)));
    let mut lost = Bank::new([steep(0.0), steep(1.0)]).expect("proper");
    assert!(lost.predict(1.0).is_err());
    assert_eq!(lost.len(), 2);
}

#[test]
fn clouds_make_a_bank_too() {
    let cloud = |east: f64, seed| {
        let prior = Estimate::isotropic(Vector2::new(east, 0.0), 1.0);
        (
            0.5,
            ParticleFilter::new(RandomWalk::uniform(0.0), Part, prior, 500, rng(seed))
                .expect("proper"),
        )
    };
    let mut bank = Bank::new([cloud(-5.0, 1), cloud(5.0, 2)]).expect("proper");
    let mut count = 0;
    bank.visit_samples(&mut |_, _| count += 1);
    assert_eq!(count, 1000);
    assert_abs_diff_eq!(bank.estimate().covariance[(0, 0)], 26.0, epsilon = 1.0);
    let noise = foxhunt_core::nalgebra::Matrix2::identity();
    let observed = Observation::new(0.0, Pose::default(), Vector2::new(4.0, 0.0), noise);
    let _ = bank.update(&observed.expect("proper")).expect("possible");
    // 4.5 is halfway between what the right one thought and what was observed.
    assert!(abs_diff_eq!(bank.estimate().mean.x, 4.5, epsilon = 0.2), "{}", bank.estimate().mean);
}

#[test]
fn improper_banks_are_refused() {
    let part = || on_a_line(0.0, 1.0);
    assert!(Bank::<Ekf<RandomWalk<1>, Part, 1, 1>, 1, 1>::new([]).is_err());
    for bad in [-1.0, f64::NAN, f64::INFINITY, 0.0] {
        assert!(Bank::new([(bad, part())]).is_err(), "{bad}");
    }
    for bad in [-0.1, 1.0, f64::NAN] {
        assert!(Bank::new([(1.0, part())]).expect("proper").with_pruning(bad).is_err(), "{bad}");
    }
}
