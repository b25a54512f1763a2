//! Exact vectors, read where they lie.

use foxhunt_core::nalgebra::{Matrix2, Vector2};
use serde_json::Value;

/// The cases under `key` in a file of vectors; `None`, said aloud, where there is no such file.
#[expect(clippy::print_stderr, reason = "a skipped test must say so")]
pub(crate) fn cases(file: &str, key: &str) -> Option<Vec<Value>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/vectors");
    let path = std::path::Path::new(folder).join(file);
    if !path.exists() {
        eprintln!("skipped: no vectors at {}", path.display());
        return None;
    }
    let text = std::fs::read_to_string(&path).expect("a file that is there can be read");
    let file: Value = serde_json::from_str(&text).expect("vectors are JSON");
    let cases = file[key].as_array().expect("the cases are a list").clone();
    assert!(!cases.is_empty(), "no cases in {}", path.display());
    Some(cases)
}

pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

pub(crate) fn vector(value: &Value) -> Vector2<f64> {
    Vector2::from_fn(|i, _| number(&value[i]))
}

pub(crate) fn matrix(value: &Value) -> Matrix2<f64> {
    Matrix2::from_fn(|i, j| number(&value[i][j]))
}
