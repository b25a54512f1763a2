//! Files that live beside the repository.

use serde_json::Value;

/// The vectors in `name`, or `None` where they are not at hand.
pub(crate) fn vectors(name: &str) -> Option<Value> {
    let text = shared(&format!("vectors/{name}"))?;
    Some(serde_json::from_str(&text).expect("the vectors are JSON"))
}

/// The text of a shared file, or `None` where it is not at hand.
#[expect(clippy::print_stderr, reason = "a test that is skipped says so")]
pub(crate) fn shared(name: &str) -> Option<String> {
    let path = format!("{}/../../shared/{name}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).ok();
    if text.is_none() {
        eprintln!("skipped: no vectors at {path}");
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
