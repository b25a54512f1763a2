use foxhunt_core::{
    Correction, Estimate, Estimator, RandomWalk,
    nalgebra::{Matrix2, Vector2},
};
use foxhunt_filters::{Ekf, Gate, GateLimit, Kalman, Transform, Ukf, Unscented};
use serde_json::Value;

use super::{
    model::{RssBearing, observations},
    vectors::{cases, matrix, number, vector},
};

type Filter<T> = Kalman<T, RandomWalk<2>, RssBearing, 2, 2>;

fn prior(case: &Value) -> Estimate<2> {
    Estimate { mean: vector(&case["x0"]), covariance: matrix(&case["P0"]) }
}

fn filter<T: Transform + Default>(case: &Value) -> Filter<T> {
    let count = |key| u32::try_from(case[key].as_u64().expect("a count")).expect("a small one");
    let gate = Gate::new(GateLimit::Nis(number(&case["gate"])))
        .expect("positive")
        .with_free_steps(count("free_steps"))
        .with_most_rejections(count("max_rejections_in_a_row"));
    let motion = RandomWalk::uniform(number(&case["Q_diag"]).sqrt());
    Kalman::new(motion, RssBearing::of(case), prior(case)).expect("a proper prior").with_gate(gate)
}

/// The largest deviation from a run, relative to the size of what is compared where that is
/// above 1; every accept flag must be equal.
fn deviation<T: Transform>(mut filter: Filter<T>, case: &Value, run: &str) -> f64 {
    let steps = case["runs"][run]["steps"].as_array().expect("a list");
    let observations = observations(case);
    assert_eq!(observations.len(), steps.len());
    let mut worst: f64 = 0.0;
    for (i, (observation, step)) in observations.iter().zip(steps).enumerate() {
        filter.predict(1.0).expect("a proper step");
        let reported = filter.innovation(observation).expect("a finite model");
        let correction = filter.update(observation).expect("a proper observation");
        let accepted = matches!(correction, Correction::Fused { .. });
        assert_eq!(accepted, step["accepted"].as_bool().expect("a flag"), "{run}, step {i}");
        let nis = correction.nis().expect("a filter with an innovation");
        let relative_nis = (nis - number(&step["nis"])) / number(&step["nis"]).max(1.0);
        let estimate = filter.estimate();
        let mut check = |actual: &[f64], exact: &[f64]| {
            for (actual, exact) in actual.iter().zip(exact) {
                worst = worst.max((actual - exact).abs() / exact.abs().max(1.0));
            }
        };
        let (x, y): (Vector2<f64>, Vector2<f64>) = (vector(&step["x"]), vector(&step["y"]));
        let (p, s): (Matrix2<f64>, Matrix2<f64>) = (matrix(&step["P"]), matrix(&step["S"]));
        check(estimate.mean.as_slice(), x.as_slice());
        check(estimate.covariance.as_slice(), p.as_slice());
        check(reported.expected.as_slice(), vector(&step["z_pred"]).as_slice());
        check(reported.residual.as_slice(), y.as_slice());
        check(reported.covariance.as_slice(), s.as_slice());
        check(&[relative_nis, reported.nis - nis], &[0.0, 0.0]);
    }
    worst
}

#[test]
fn the_ekf_follows_the_exact_runs() {
    let cases = cases("filter_runs.json", "sequences");
    for case in cases {
        let worst = deviation(filter::<foxhunt_filters::Taylor>(&case), &case, "ekf");
        assert!(worst < 1e-10, "{}: off by {worst:e}", case["name"]);
    }
}

#[test]
fn the_ukf_follows_the_exact_runs_with_points_redrawn() {
    let cases = cases("filter_runs.json", "sequences");
    for case in cases {
        let [alpha, beta, kappa] = ["alpha", "beta", "kappa"].map(|key| number(&case[key]));
        let transform = Unscented::new(alpha, beta, kappa).expect("in range");
        let ukf = filter::<Unscented>(&case).with_transform(transform).expect("n + κ = 3");
        let worst = deviation(ukf.clone(), &case, "ukf_redraw");
        assert!(worst < 1e-6, "{}: off by {worst:e}", case["name"]);
        // Points that are not redrawn after predict carry no process noise: another filter, but
        // for a target without any.
        let kept = deviation(ukf, &case, "ukf");
        assert_eq!(kept < 1e-6, number(&case["Q_diag"]) <= 0.0, "{}: {kept:e}", case["name"]);
    }
}

#[test]
fn the_presets_are_the_reference() {
    let cases = cases("filter_runs.json", "sequences");
    let reference = cases.iter().filter(|case| number(&case["Q_diag"]) > 0.0);
    for case in reference {
        let ekf = Ekf::pritzl2018(RssBearing::of(case), prior(case)).expect("a proper prior");
        assert!(deviation(ekf, case, "ekf") < 1e-10, "{}", case["name"]);
        let ukf = Ukf::pritzl2018(RssBearing::of(case), prior(case)).expect("a proper prior");
        assert!(deviation(ukf, case, "ukf_redraw") < 1e-6, "{}", case["name"]);
    }
}
