use std::cell::RefCell;

use foxhunt_core::{
    Estimate, MeasurementModel, Pose, Role,
    nalgebra::{Matrix1, Matrix2, Vector1, Vector2},
};
use foxhunt_filters::{Cubature, Gaussian, Map, Transform, Unscented};

use super::{
    model::RssBearing,
    vectors::{cases, matrix, number, vector},
};

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
    assert!((cross[0] - 2.0 * m * v).abs() < 1e-13);
    assert!((cross[1] - (3.0 * m * m * v + 3.0 * v * v)).abs() < 1e-13);
    let covariance = image.whitened_cross.transpose() * image.whitened_cross
        + image.unexplained * image.unexplained.transpose();
    assert!((covariance[(0, 0)] - (4.0 * m * m * v + 2.0 * v * v)).abs() < 1e-13);
    // E[x⁵] − E[x²] E[x³].
    let fifth = m.powi(5) + 10.0 * m.powi(3) * v + 15.0 * m * v * v;
    assert!((covariance[(0, 1)] - (fifth - mean[0] * mean[1])).abs() < 1e-12);
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
