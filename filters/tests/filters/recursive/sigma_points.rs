//! Sigma points, and losses of the Kalman family against the exact posterior where the model is far
//! from linear over the prior; truth is drawn from the prior, run `i` from seed `i`.

use approx::assert_abs_diff_eq;
use std::cell::RefCell;

use foxhunt_core::{
    Estimate, Estimator, MeasurementModel, Observation, Pose, RandomWalk, Role, State,
    nalgebra::{Matrix1, Matrix2, Vector1, Vector2},
};
use foxhunt_filters::{Ckf, Cubature, Ekf, Gaussian, Iterations, Map, Transform, Ukf, Unscented};
use rand::RngExt;
use rand_distr::StandardNormal;

use super::{
    edges::rng,
    iterated::exact,
    model::{FIELD, RssBearing, cases, matrix, number, observed, vector},
};

const NAMES: [&str; 6] = ["exact", "EKF", "UKF", "CKF", "iterated EKF", "iterated CKF"];
const RUNS: u32 = 300;
const SIGMA_RSS_DB: f64 = 4.0;
/// The reference's prior, √70 m.
const SIGMA: f64 = 8.4;

/// A measurement model as a map that notes where it is evaluated.
struct Watched {
    model: RssBearing,
    receiver: Pose,
    requested: RefCell<Vec<Vector2<f64>>>,
}

impl Map<2, 2> for Watched {
    fn value(&self, x: &Vector2<f64>) -> Vector2<f64> {
        self.requested.borrow_mut().push(*x);
        self.model.expected(x, &self.receiver)
    }
    fn jacobian(&self, x: &Vector2<f64>) -> Matrix2<f64> {
        self.model.jacobian(x, &self.receiver)
    }
    fn minus(&self, y: &Vector2<f64>, z: &Vector2<f64>) -> Vector2<f64> {
        self.model.residual(y, z)
    }
}

/// x ↦ (x², x³): polynomials whose moments under a Gaussian are known.
struct Powers;

impl Map<1, 2> for Powers {
    fn value(&self, x: &Vector1<f64>) -> Vector2<f64> {
        Vector2::new(x[0].powi(2), x[0].powi(3))
    }
    fn jacobian(&self, x: &Vector1<f64>) -> foxhunt_core::nalgebra::Matrix2x1<f64> {
        Vector2::new(2.0 * x[0], 3.0 * x[0].powi(2))
    }
    fn minus(&self, y: &Vector2<f64>, z: &Vector2<f64>) -> Vector2<f64> {
        y - z
    }
}

/// (E, N) ↦ (E² N, E + N²): of degree 3, and 2.
struct Cubic;

impl Map<2, 2> for Cubic {
    fn value(&self, x: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(x[0] * x[0] * x[1], x[0] + x[1] * x[1])
    }
    fn jacobian(&self, x: &Vector2<f64>) -> Matrix2<f64> {
        Matrix2::new(2.0 * x[0] * x[1], x[0] * x[0], 1.0, 2.0 * x[1])
    }
    fn minus(&self, y: &Vector2<f64>, z: &Vector2<f64>) -> Vector2<f64> {
        y - z
    }
}

struct Problem {
    /// Distance of the listening drone from the prior mean, in metres.
    radius: f64,
    steps: u32,
    sigma_bearing: f64,
    rss: bool,
}

/// Limits for a problem: at most of the iterated CKF, its error over the exact posterior's, and its
/// ANEES; at least of every filter that linearises once.
struct Band {
    iterated: (f64, f64),
    once: (f64, f64),
}

#[test]
fn points_and_moments_are_the_exact_ones() {
    let cases = cases("sigma_points.json", "cases");
    for case in cases {
        let alpha = number(&case["alpha"]);
        let mav = &case["mav"];
        let transform = Unscented::new(alpha, number(&case["beta"]), number(&case["kappa"]));
        let map = Watched {
            model: RssBearing::of(&case),
            receiver: Pose::at(number(&mav[0]), number(&mav[1]), number(&mav[2])),
            requested: RefCell::default(),
        };
        let prior = Estimate { mean: vector(&case["mean"]), covariance: matrix(&case["cov"]) };
        let source = Gaussian::new(prior, Role::Prior).expect("a proper prior");
        let image = transform.expect("in range").image(&source, &map);

        let requested = map.requested.into_inner();
        let points = case["sigma_points"].as_array().expect("a list");
        assert_eq!(requested.len(), points.len());
        for (point, order) in points.iter().zip([0, 1, 3, 2, 4]) {
            let error = (requested[order] - vector(point)).norm();
            assert!(error < 1e-9, "α = {alpha}: a point is off by {error}");
        }
        // The vectors' README: α = 1e-3 costs eight digits.
        let tolerance = if alpha < 0.5 { 1e-6 } else { 1e-10 };
        let v = image.whitened_cross;
        let covariance = v.transpose() * v + image.unexplained * image.unexplained.transpose();
        for (what, error) in [
            ("mean", (image.mean - vector(&case["z_mean"])).norm()),
            ("covariance", (covariance - matrix(&case["Pz_without_R"])).norm()),
            ("cross covariance", (source.factor() * v - matrix(&case["Pxz"])).norm()),
        ] {
            assert!(error < tolerance, "α = {alpha}: the {what} is off by {error}");
        }
    }
}

#[test]
fn the_scalar_transform_with_n_plus_kappa_3_is_exact_to_the_fifth_power() {
    // With α = 1, β = 0, κ = 2 the points are those of the three-point Gauss-Hermite rule, which
    // is exact to degree 5: for means of x² and x³, for E[x²·x²], for E[x²·x³].
    let m = 1.5_f64;
    let v = 0.3;
    let prior = Estimate { mean: Vector1::new(m), covariance: Matrix1::new(v) };
    let source = Gaussian::new(prior, Role::Prior).expect("a proper prior");
    let image = Unscented::new(1.0, 0.0, 2.0).expect("in range").image(&source, &Powers);
    let mean = Vector2::new(m * m + v, m.powi(3) + 3.0 * m * v);
    assert!((image.mean - mean).norm() < 1e-13);
    let cross = source.factor() * image.whitened_cross;
    assert_abs_diff_eq!(cross[0], 2.0 * m * v, epsilon = 1e-13);
    assert_abs_diff_eq!(cross[1], 3.0 * m * m * v + 3.0 * v * v, epsilon = 1e-13);
    let covariance = image.whitened_cross.transpose() * image.whitened_cross
        + image.unexplained * image.unexplained.transpose();
    assert_abs_diff_eq!(covariance[(0, 0)], 4.0 * m * m * v + 2.0 * v * v, epsilon = 1e-13);
    // E[x⁵] − E[x²] E[x³].
    let fifth = m.powi(5) + 10.0 * m.powi(3) * v + 15.0 * m * v * v;
    assert_abs_diff_eq!(covariance[(0, 1)], fifth - mean[0] * mean[1], epsilon = 1e-12);
}

#[test]
fn the_cubature_rule_is_exact_to_the_third_power() {
    // Isserlis: E[(m+u)² (n+v)] = (m² + a) n + 2 m b, with a, b, d the covariance's elements. The
    // cross covariance with the second component is of degree 3 too; that with the first is not.
    let m = 1.5;
    let n = -0.7;
    let a = 0.9;
    let b = 0.4;
    let d = 1.3;
    let prior = Estimate { mean: Vector2::new(m, n), covariance: Matrix2::new(a, b, b, d) };
    let source = Gaussian::new(prior, Role::Prior).expect("a proper prior");
    let image = Cubature.image(&source, &Cubic);
    let mean = Vector2::new((m * m + a) * n + 2.0 * m * b, m + n * n + d);
    assert!((image.mean - mean).norm() < 1e-14, "{}", image.mean);
    let cross = source.factor() * image.whitened_cross;
    let second = Vector2::new(a + 2.0 * n * b, b + 2.0 * n * d);
    assert!((cross.column(1) - second).norm() < 1e-14, "{cross}");
    // The covariance is the textbook's sum over the 2n points of equal weight.
    let mut spread = Matrix2::zeros();
    for (i, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
        let x = prior.mean + source.factor().column(i) * (sign * 2.0_f64.sqrt());
        let y = Cubic.value(&x) - mean;
        spread += y * y.transpose() / 4.0;
    }
    let v = image.whitened_cross;
    let covariance = v.transpose() * v + image.unexplained * image.unexplained.transpose();
    assert!((covariance - spread).norm() < 1e-13, "{covariance}");
}

#[test]
fn parameters_out_of_range_are_refused() {
    use foxhunt_filters::Kappa;
    for (alpha, beta, kappa) in [
        (0.0, 2.0, 0.0),
        (1.5, 2.0, 0.0),
        (f64::NAN, 2.0, 0.0),
        (1.0, -1.0, 0.0),
        (1.0, f64::INFINITY, 0.0),
        (1.0, 2.0, f64::NAN),
    ] {
        assert!(Unscented::new(alpha, beta, kappa).is_err(), "{alpha} {beta} {kappa}");
    }
    let flat = Unscented::new(1.0, 2.0, -2.0).expect("may suit some dimension");
    assert!(flat.check(2).is_err(), "n + κ = 0");
    assert!(flat.check(3).is_ok());
    let plain = Unscented::new(1.0, 0.0, Kappa::ThreeMinusN).expect("may suit some dimension");
    assert!(plain.check(3).is_ok());
    assert!(plain.check(4).is_err(), "the image's covariance could be indefinite");
    for n in 1..9 {
        assert!(Unscented::pritzl2018().check(n).is_ok() && Unscented::default().check(n).is_ok());
    }
}

fn all(prior: Estimate<2>) -> [Box<dyn Estimator<2, 2>>; 5] {
    let still = RandomWalk::uniform(0.0);
    let proper = "a proper prior";
    let ten = Iterations::at_most(10).expect("at least one");
    [
        Box::new(Ekf::new(still, FIELD, prior).expect(proper)),
        Box::new(Ukf::new(still, FIELD, prior).expect(proper)),
        Box::new(Ckf::new(still, FIELD, prior).expect(proper)),
        Box::new(Ekf::new(still, FIELD, prior).expect(proper).with_iterations(ten)),
        Box::new(Ckf::new(still, FIELD, prior).expect(proper).with_iterations(ten)),
    ]
}

/// Returns each estimator's rms error over the one of the exact posterior's mean, and its ANEES.
fn report(problem: &Problem) -> [(f64, f64); 6] {
    let mut squares = [0.0; 6];
    let mut nees = [0.0; 6];
    for seed in 0..u64::from(RUNS) {
        let mut rng = rng(seed);
        let mut white = || -> State<2> { State::from_fn(|_, _| rng.sample(StandardNormal)) };
        let prior = Estimate::isotropic(Vector2::new(6.0, -3.0), SIGMA);
        let truth = prior.mean + white() * SIGMA;
        let mut filters = all(prior);
        let observe = |step: u32| -> Observation<2> {
            let around = 2.1 * f64::from(step);
            let place = prior.mean + Vector2::new(around.cos(), around.sin()) * problem.radius;
            let receiver = Pose::at(place.x, place.y, 4.0);
            let noise = Vector2::new(SIGMA_RSS_DB, problem.sigma_bearing).component_mul(&white());
            let z = FIELD.expected(&truth, &receiver) + noise;
            let whole = observed(receiver, z, SIGMA_RSS_DB, problem.sigma_bearing);
            if problem.rss { whole } else { whole.without(0) }
        };
        let observations: Vec<_> = (0..problem.steps).map(observe).collect();
        let mut reported = vec![exact(&prior, &observations).0];
        for filter in &mut filters {
            for observation in &observations {
                let _ = filter.update(observation).expect("possible");
            }
            reported.push(filter.estimate());
        }
        for (i, estimate) in reported.iter().enumerate() {
            squares[i] += (estimate.mean - truth).norm_squared();
            nees[i] += estimate.nees(&truth).expect("positive definite") / f64::from(RUNS);
        }
    }
    core::array::from_fn(|i| ((squares[i] / squares[0]).sqrt(), nees[i]))
}

/// The bands leave the seeded figures, which are fixed, a tenth or more; another stream would
/// move an rms of `RUNS` runs by 3 to 4 % and an ANEES by 0.2, one standard error.
fn assert_within(problem: &Problem, band: &Band) -> [(f64, f64); 6] {
    let reported = report(problem);
    let [(_, exact), once @ .., _, (error, anees)] = &reported;
    // E[NEES] = 2 for the exact posterior: three standard errors.
    assert_abs_diff_eq!(*exact, 2.0, epsilon = 0.4);
    assert!(*error < band.iterated.0 && *anees < band.iterated.1, "{NAMES:?}: {reported:?}");
    for (error, anees) in once {
        assert!(*error > band.once.0 && *anees > band.once.1, "{NAMES:?}: {reported:?}");
    }
    reported
}

#[test]
fn precise_bearings_and_power_from_near_by() {
    let near = Problem { radius: 20.0, steps: 3, sigma_bearing: 0.05, rss: true };
    let reported = assert_within(&near, &Band { iterated: (1.25, 3.0), once: (4.0, 20.0) });
    let (error, anees) = reported[4];
    assert!(error < 1.15 && anees < 3.5, "iterated EKF: {error}, ANEES {anees}");
}

#[test]
fn three_precise_bearings() {
    let bearings = Problem { radius: 30.0, steps: 3, sigma_bearing: 0.05, rss: false };
    let reported = assert_within(&bearings, &Band { iterated: (1.1, 2.7), once: (1.3, 4.0) });
    let (error, anees) = reported[4];
    assert!(error < 1.1 && anees < 2.7, "iterated EKF: {error}, ANEES {anees}");
}

#[test]
fn a_flight_through_the_prior() {
    let wild = Problem { radius: 8.0, steps: 20, sigma_bearing: 0.52, rss: true };
    let reported = assert_within(&wild, &Band { iterated: (1.18, 3.0), once: (1.4, 4.0) });
    // Close by, the most probable place is on the receiver, and a tangent there claims that it is
    // known to the centimetre: only points show that it is not. The place itself is good.
    let (error, anees) = reported[4];
    assert!(error < 1.25 && anees > 10.0, "iterated EKF: {error}, ANEES {anees}");
}
