//! Printed results fit the screen.

use std::process::Command;

use crate::support::{folder, foxhunt};

/// Width of the widest line that a command prints on a screen with this number of columns, and its
/// text.
fn widest(args: &[&str], columns: &str) -> (usize, String) {
    let ran = Command::new(env!("CARGO_BIN_EXE_foxhunt"))
        .args(args)
        .env("COLUMNS", columns)
        .output()
        .expect("the program was built for this test");
    assert!(ran.status.success(), "{args:?}: {ran:?}");
    let text = String::from_utf8(ran.stdout).expect("UTF-8");
    let lines = text.lines().filter(|line| !line.contains('/'));
    (lines.map(|line| line.chars().count()).max().unwrap_or(0), text)
}

#[test]
fn tables_fit_80_100_and_160_columns() {
    let folder = folder("screen");
    let out = folder.to_str().expect("UTF-8");
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../archive/tests/data");
    let file = |name: &str| format!("{data}/{name}");
    let bearings = file("otter-telemetry/bearings.csv");
    let turns = file("foxhunt/turns.csv");
    let quiet = ["--runs", "2", "--quiet"];
    let commands: Vec<Vec<&str>> = vec![
        vec!["list", "estimators"],
        vec!["list", "estimators", "--all"],
        vec!["list", "keys"],
        vec!["list", "scenarios"],
        vec!["list", "planners"],
        [&["campaign", "--estimator", "ekf-pritzl2018"], &quiet[..]].concat(),
        [&["compare", "antennas", "--estimator", "ekf"], &quiet[..]].concat(),
        [&["compare", "extractors"], &quiet[..]].concat(),
        [&["compare", "estimators", "bot-m"], &quiet[..]].concat(),
        [&["compare", "planners", "one-drone", "--planner", "hold"], &quiet[..]].concat(),
        vec!["hunt", "--out", out],
        vec!["bearing", &turns, "--all"],
        vec!["locate", &bearings, "--every-beacon"],
        vec!["judge", &bearings],
    ];
    for args in &commands {
        for columns in ["80", "100", "160"] {
            let (width, text) = widest(args, columns);
            let columns: usize = columns.parse().expect("a number");
            assert!(width <= columns, "{args:?} is {width} wide on {columns}:\n{text}");
        }
        // Nothing is lost on the way: the words are the same, if in another order.
        let words = |columns: &str| {
            let (_, text) = widest(args, columns);
            let of_words = |c: char| c.is_whitespace() || c == '─' || c == ':' || c == ',';
            let mut words: Vec<String> =
                text.split(of_words).filter(|word| !word.is_empty()).map(str::to_owned).collect();
            words.sort();
            words.dedup();
            // Blocks have neither dashes nor what their names are.
            words
                .retain(|word| !["-", "scenario", "estimator", "planner"].contains(&word.as_str()));
            words
        };
        assert_eq!(words("80"), words("160"), "{args:?}");
    }
}

#[test]
fn a_pipe_has_lines_of_100_columns() {
    let ran = foxhunt(["list", "estimators"]);
    let widest = ran.stdout.lines().map(|line| line.chars().count()).max();
    assert!(widest <= Some(100) && widest > Some(90), "{widest:?}");
}
