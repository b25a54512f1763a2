//! Exact vectors, read from `vectors/` at the root of the repository.

use foxhunt_core::nalgebra::{Matrix2, Vector2};
use serde_json::Value;

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
