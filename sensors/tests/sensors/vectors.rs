//! Exact vectors, which belong to the repository, and recordings, which may lie beside it.

use serde_json::Value;

/// The vectors in `name`; without them a test fails.
pub(crate) fn vectors(name: &str) -> Value {
    let path = format!(concat!(env!("CARGO_MANIFEST_DIR"), "/../vectors/{}"), name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    serde_json::from_str(&text).expect("the vectors are JSON")
}

/// The text of a file of recordings beside the repository, or `None` where it is not at hand.
#[expect(clippy::print_stderr, reason = "a test that is skipped must not look as if it had run")]
pub(crate) fn shared(name: &str) -> Option<String> {
    let path = format!("{}/../../shared/{name}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).ok();
    if text.is_none() {
        eprintln!("skipped: there is no {path}");
    }
    text
}

/// The number in `value`; `null` is `None`.
pub(crate) fn number(value: &Value) -> Option<f64> {
    value.as_f64()
}

/// The numbers in `value`, each of which may be `null`.
pub(crate) fn numbers(value: &Value) -> Vec<Option<f64>> {
    value.as_array().expect("a list").iter().map(number).collect()
}

/// The numbers in `value`, all of which are there.
pub(crate) fn all_numbers(value: &Value) -> Vec<f64> {
    numbers(value).into_iter().map(|v| v.expect("a number")).collect()
}
