//! The formation's vertices against the exact vectors.

use std::{fs, path::Path};

use foxhunt_formation::Polygon;
use nalgebra::{Vector2, Vector3};
use serde_json::Value;

#[test]
fn vertices() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/vectors/model.json");
    if !Path::new(path).exists() {
        println!("skipped: no vectors at {path}");
        return;
    }
    let text = fs::read_to_string(path).expect("it exists");
    let vectors: Value = serde_json::from_str(&text).expect("the vectors are JSON");
    let number = |v: &Value| v.as_f64().expect("a number");
    let cases = vectors["formation"].as_array().expect("a list");
    assert!(!cases.is_empty());
    for case in cases {
        let centre = Vector2::new(number(&case["centre"][0]), number(&case["centre"][1]));
        let polygon = Polygon { circumradius: number(&case["r"]) };
        let (theta, altitude) = (number(&case["theta"]), number(&case["alt"]));
        for (i, vertex) in case["vertices"].as_array().expect("a list").iter().enumerate() {
            let expected = Vector3::from_fn(|row, _| number(&vertex[row]));
            let error = (polygon.vertex(&centre, theta, altitude, i, 3) - expected).norm();
            assert!(error < 1e-12, "vertex {i} is off by {error}");
        }
    }
}
