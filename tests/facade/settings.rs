//! Settings count: a change of one changes what is found, or is refused.

use std::path::Path;

use foxhunt::{
    config::EstimatorConfig, core::Estimate, log::Log, prelude::*, registry::EstimatorEntry,
    replay::replay,
};
use serde_json::Value;

/// A path of keys through a table.
type Keys = Vec<String>;

/// Receptions of the first beacon that are replayed: enough for all but the rarest rules.
const RECEPTIONS: usize = 20;

/// The paths to all numbers and flags of a table.
fn leaves(value: &Value, at: &Keys, to: &mut Vec<Keys>) {
    match value {
        Value::Object(table) => {
            for (key, value) in table {
                let path: Keys = at.iter().chain([key]).cloned().collect();
                leaves(value, &path, to);
            }
        }
        Value::Number(_) | Value::Bool(_) => to.push(at.clone()),
        _ => {}
    }
}

/// The table with another value at a path: a flag turned, a number doubled, 0 replaced by 1.
fn changed(table: &Value, path: &Keys) -> Value {
    let mut table = table.clone();
    let leaf = table.pointer_mut(&format!("/{}", path.join("/"))).expect("a path of it");
    *leaf = match leaf {
        Value::Bool(flag) => Value::Bool(!*flag),
        Value::Number(number) => match number.as_u64() {
            Some(0) => Value::from(1),
            Some(whole) => Value::from(2 * whole),
            None => Value::from(2.0 * number.as_f64().expect("a number")),
        },
        other => panic!("{other} is no number and no flag"),
    };
    table
}

/// The estimates after each reception, or the reason why there are none.
fn found(log: &Log, settings: EstimatorConfig) -> Result<Vec<Estimate<2>>, String> {
    let entry = EstimatorEntry::of_settings("changed", "a setting changed", "a test", settings);
    let registry = Registry::builtin();
    let replayed = replay(log, &registry, Some(&entry)).map_err(|error| error.to_string())?;
    Ok(replayed.fixes.iter().map(|fix| fix.estimate).collect())
}

fn short_log() -> Log {
    let path = "archive/tests/data/logs/version-5-default.jsonl";
    let mut log = Log::read(Path::new(path)).expect("a committed log");
    let mut received = 0;
    log.events.retain(|event| {
        received += usize::from(matches!(event, Event::Received { .. }));
        received <= RECEPTIONS
    });
    log
}

#[test]
fn every_setting_of_an_estimator_counts() {
    let log = short_log();
    let registry = Registry::builtin();
    let mut seen: Vec<(String, Keys)> = Vec::new();
    let mut idle = Vec::new();
    for entry in registry.estimators() {
        let Some(settings) = entry.settings() else { continue };
        let table = serde_json::to_value(settings).expect("plain data");
        let filter = table["filter"]["kind"].as_str().expect("a kind");
        let kind = format!("{filter}, moving: {}", settings.moving.is_some());
        let mut paths = Vec::new();
        leaves(&table, &Keys::new(), &mut paths);
        paths.retain(|path| !seen.contains(&(kind.clone(), path.clone())));
        if paths.is_empty() {
            continue;
        }
        let usual = found(&log, *settings);
        assert!(usual.is_ok(), "{}: {usual:?}", entry.name);
        for path in paths {
            seen.push((kind.clone(), path.clone()));
            let Ok(other) = serde_json::from_value(changed(&table, &path)) else { continue };
            let other = found(&log, other);
            if other.is_ok() && other == usual {
                idle.push(format!("{}: {}", entry.name, path.join(".")));
            }
        }
    }
    assert!(idle.is_empty(), "these change nothing: {idle:#?}");
}
