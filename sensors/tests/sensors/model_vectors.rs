//! h, its Jacobian and the bearing mixture, against the shared vectors.

use approx::assert_abs_diff_eq;
use foxhunt_core::{MeasurementModel, Observation, Pose};
use foxhunt_sensors::{BearingMixture, BearingOnly, LogDistance, RssBearing};
use nalgebra::{Matrix1, Matrix2, Vector1, Vector2};
use serde_json::Value;

use crate::vectors::{all_numbers, number, vectors};

fn matrix(value: &Value) -> Matrix2<f64> {
    let rows = value.as_array().expect("rows");
    let cells: Vec<f64> = rows.iter().flat_map(all_numbers).collect();
    Matrix2::from_row_slice(&cells)
}

#[test]
fn expectation_and_jacobian_agree() {
    let file = vectors("model.json");
    let cases = file["measurement"].as_array().expect("a list");
    assert_eq!(cases.len(), 40);
    for case in cases {
        let law = LogDistance::new(
            number(&case["p0"]).expect("P0"),
            number(&case["gamma"]).expect("an exponent"),
        );
        let model = RssBearing::new(law.expect("in range"));
        let state = Vector2::from_column_slice(&all_numbers(&case["x"]));
        let drone = all_numbers(&case["mav"]);
        let receiver = Pose::at(drone[0], drone[1], drone[2]);
        let h = Vector2::from_column_slice(&all_numbers(&case["h"]));
        let error = (model.expected(&state, &receiver) - h).amax();
        assert!(error < 1e-12, "h is off by {error}");
        let error = (model.jacobian(&state, &receiver) - matrix(&case["jacobian"])).amax();
        assert!(error < 1e-12, "the Jacobian is off by {error}");
    }
}

#[test]
fn the_bearing_mixture_agrees() {
    let file = vectors("mixture.json");
    let mixture = BearingMixture::new(
        number(&file["p_o"]).expect("a share"),
        number(&file["mu"]).expect("a bias"),
        number(&file["sigma"]).expect("a σ"),
    );
    let mixture = mixture.expect("in range");
    assert_eq!(mixture, BearingMixture::isaacs2014());
    for row in file["pdf"].as_array().expect("a list") {
        let (e, f) = (number(&row["e"]).expect("e"), number(&row["f"]).expect("f"));
        assert!((mixture.density(e) - f).abs() < 1e-9, "f({e}) is {}", mixture.density(e));
        assert!((likelihood(e) - f).abs() < 1e-9, "the model's f({e}) is {}", likelihood(e));
    }
    let theirs = number(&file["bearing_information"]).expect("an information");
    let information = mixture.fisher_information();
    assert_abs_diff_eq!(information, theirs, epsilon = 1e-9);
}

/// The likelihood under [`BearingOnly`] of a bearing that is `e` radians off.
fn likelihood(e: f64) -> f64 {
    const SIGMA: f64 = 0.2468;
    let (receiver, state) = (Pose::at(1.0, 2.0, 3.0), Vector2::new(-4.0, 2.0));
    let bearing = Vector1::new(core::f64::consts::PI + e);
    let observation = Observation::new(0.0, receiver, bearing, Matrix1::new(SIGMA * SIGMA));
    let observation = observation.expect("proper");
    BearingOnly::isaacs2014().log_likelihood(&state, &observation).exp()
}
