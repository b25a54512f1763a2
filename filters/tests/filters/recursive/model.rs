//! Parts that the tests share: the measurement model of the reference (filters know no sensors),
//! runs and posteriors of it, and exact vectors, read from `vectors/` at the root of the
//! repository.

use foxhunt_core::{
    Correction, Estimate, Estimator, MeasurementModel, Observation, Pose, Quantity, RandomWalk,
    State,
    nalgebra::{Matrix2, Vector2},
};
use foxhunt_filters::{Ekf, Gate, GateLimit, Kalman, ParticleFilter, Transform, Ukf, Unscented};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};
use serde_json::Value;

/// The field calibration of Pritzl 2018, §7.1.
pub(super) const FIELD: RssBearing = RssBearing { p0_dbm: -29.06, exponent: 2.765 };

/// Nearer than this [m] a bearing has no derivative and a path no loss.
const LEAST: f64 = 1e-6;

/// RSS [dBm] and bearing [rad] of a beacon on the ground (Pritzl 2018, eq. 3.7).
#[derive(Clone, Copy, Debug)]
pub(super) struct RssBearing {
    pub(super) p0_dbm: f64,
    pub(super) exponent: f64,
}

impl RssBearing {
    pub(super) fn of(case: &Value) -> Self {
        Self { p0_dbm: number(&case["p0"]), exponent: number(&case["gamma"]) }
    }
}

impl MeasurementModel<2, 2> for RssBearing {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RSS, Quantity::BEARING]
    }

    fn expected(&self, beacon: &State<2>, receiver: &Pose) -> Vector2<f64> {
        let d = beacon - receiver.position.xy();
        let range = libm::hypot(d.norm(), receiver.position.z).max(LEAST);
        let rss_dbm = self.p0_dbm - 10.0 * self.exponent * libm::log10(range);
        Vector2::new(rss_dbm, libm::atan2(d.y, d.x))
    }

    fn jacobian(&self, beacon: &State<2>, receiver: &Pose) -> Matrix2<f64> {
        let d = beacon - receiver.position.xy();
        let flat = d.norm_squared();
        let up = receiver.position.z;
        if flat < LEAST * LEAST {
            return Matrix2::zeros();
        }
        let slope = -10.0 * self.exponent / core::f64::consts::LN_10 / (flat + up * up);
        Matrix2::new(slope * d.x, slope * d.y, -d.y / flat, d.x / flat)
    }
}

type Filter<T> = Kalman<T, RandomWalk<2>, RssBearing, 2, 2>;

/// An observation of RSS and bearing with independent noise.
pub(super) fn observed(
    receiver: Pose,
    z: Vector2<f64>,
    sigma_rss_db: f64,
    sigma: f64,
) -> Observation<2> {
    let noise = Matrix2::from_diagonal(&Vector2::new(sigma_rss_db.powi(2), sigma.powi(2)));
    Observation::new(0.0, receiver, z, noise).expect("finite, of positive variance")
}

/// The observations of a sequence of vectors.
pub(super) fn observations(case: &Value) -> Vec<Observation<2>> {
    let steps = case["z"].as_array().expect("a list").len();
    let pose = |i: usize| {
        let at = &case["mav"][i];
        Pose::at(number(&at[0]), number(&at[1]), number(&at[2]))
    };
    (0..steps)
        .map(|i| {
            let rss = number(&case["sigma_rss"][i]);
            let bearing = number(&case["sigma_theta"][i]);
            observed(pose(i), vector(&case["z"][i]), rss, bearing)
        })
        .collect()
}

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

#[test]
fn twenty_thousand_particles_reach_the_exact_posterior() {
    let cases = cases("posterior_rss_aoa.json", "sequences");
    for case in cases {
        let name = &case["name"];
        let prior = Estimate {
            mean: vector(&case["prior"]["mean"]),
            covariance: Matrix2::from_diagonal_element(number(&case["prior"]["var"])),
        };
        let drift = case["process_noise_std_per_step"].as_f64().unwrap_or(0.0);
        let rng = Xoshiro256PlusPlus::seed_from_u64(9);
        let model = RssBearing::of(&case);
        let mut filter = ParticleFilter::new(RandomWalk::uniform(drift), model, prior, 20_000, rng)
            .expect("a proper prior");
        let mut log_evidence = 0.0;
        let steps = case["posterior"].as_array().expect("a list");
        for (i, (observation, exact)) in observations(&case).iter().zip(steps).enumerate() {
            filter.predict(1.0).expect("a proper step");
            let Ok(Correction::Fused { log_evidence: reported, .. }) = filter.update(observation)
            else {
                panic!("{name}: step {i} was not fused");
            };
            log_evidence += reported;
            let exact_covariance: Matrix2<f64> = matrix(&exact["cov"]);
            let root = exact_covariance.cholesky().expect("a proper posterior").unpack();
            let whitened: Vector2<f64> = root
                .solve_lower_triangular(&(filter.estimate().mean - vector(&exact["mean"])))
                .expect("a proper posterior");
            // √(n / ESS) is the growth of the cloud's own error √(P / n): 0.02 to 0.05 here.
            // The rest of the bound is the kernel's, which smooths what is not Gaussian.
            assert!(whitened.norm() < 0.2, "{name}, step {i}: mean off by {}", whitened.norm());
            let error = log_evidence - number(&exact["log_evidence"]);
            assert!(error.abs() < 0.2, "{name}, step {i}: log-evidence off by {error}");
        }
    }
}

/// The cases under `key` in a file of vectors. A file that is missing fails the test.
pub(super) fn cases(file: &str, key: &str) -> Vec<Value> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../vectors");
    let path = std::path::Path::new(folder).join(file);
    let text = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("the vectors at {}: {error}", path.display()));
    let file: Value = serde_json::from_str(&text).expect("vectors are JSON");
    let cases = file[key].as_array().expect("the cases are a list").clone();
    assert!(!cases.is_empty(), "no cases in {}", path.display());
    cases
}

pub(super) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

pub(super) fn vector(value: &Value) -> Vector2<f64> {
    Vector2::from_fn(|i, _| number(&value[i]))
}

pub(super) fn matrix(value: &Value) -> Matrix2<f64> {
    Matrix2::from_fn(|i, j| number(&value[i][j]))
}
