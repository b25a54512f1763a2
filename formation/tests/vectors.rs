//! The formation's vertices against the exact vectors in `model.json` that are of a formation.

use foxhunt_formation::Polygon;
use nalgebra::{Vector2, Vector3};
use serde_json::Value;

#[test]
fn vertices() {
    let text = include_str!("vectors/vertices.json");
    let cases: Vec<Value> = serde_json::from_str(text).expect("the vectors are JSON");
    let number = |v: &Value| v.as_f64().expect("a number");
    assert_eq!(cases.len(), 8);
    for case in &cases {
        let centre = Vector2::new(number(&case["centre"][0]), number(&case["centre"][1]));
        let polygon = Polygon { circumradius: number(&case["r"]) };
        let rotation = number(&case["theta"]);
        let altitude = number(&case["alt"]);
        let vertices = case["vertices"].as_array().expect("a list");
        assert_eq!(vertices.len(), 3);
        for (i, vertex) in vertices.iter().enumerate() {
            let expected = Vector3::from_fn(|row, _| number(&vertex[row]));
            let error = (polygon.vertex(&centre, rotation, altitude, i, 3) - expected).norm();
            assert!(error < 1e-12, "vertex {i} is off by {error}");
        }
    }
}
