use std::fs;

use crate::support::{folder, foxhunt, has, scenario};

#[test]
fn a_hunt_leaves_json_a_log_and_a_picture() {
    // Two folders deep: it is made where it is missing.
    let out = folder("hunt").join("a/b");
    let out = out.to_str().expect("the target folder is UTF-8");
    let first = foxhunt(["hunt", "--json", "--seed", "3", "--out", out]);
    let report = first.json();
    has(&report, &["seed", "estimator", "beacons"]);
    assert_eq!(report["seed"], 3);
    assert_eq!(report["estimator"], "default");
    let beacons = report["beacons"].as_array().expect("a list");
    assert_eq!(beacons.len(), 2);
    for beacon in beacons {
        has(
            beacon,
            &[
                "name",
                "truth",
                "estimate",
                "error_m",
                "nees",
                "steps",
                "steps_to_3m",
                "time_to_3m_s",
                "path_m",
                "formation_positions",
                "outcome",
            ],
        );
        has(&beacon["truth"], &["east_m", "north_m"]);
        has(&beacon["estimate"], &["east_m", "north_m", "covariance_m2"]);
        assert!(beacon["estimate"]["covariance_m2"][1][1].as_f64().expect("a number") > 0.0);
        assert!(beacon["error_m"].as_f64().expect("a number") < 30.0);
        assert!(beacon["path_m"].as_f64().expect("a number") > 10.0);
        assert!(beacon["steps_to_3m"].as_u64() <= beacon["steps"].as_u64());
    }
    assert!(first.stderr.contains("looking for beacon 2"), "progress: {}", first.stderr);

    let svg = fs::read_to_string(format!("{out}/hunt.svg")).expect("a picture");
    assert!(svg.starts_with("<svg") && svg.contains("pritzl-6.1"));
    let log = fs::read_to_string(format!("{out}/hunt.jsonl")).expect("a log");
    assert!(log.lines().count() > 100);
    assert!(log.lines().all(|line| serde_json::from_str::<serde_json::Value>(line).is_ok()));

    let again = foxhunt(["--json", "hunt", "pritzl-6.1", "--seed", "3", "--out", out]);
    assert_eq!(again.stdout, first.stdout, "the same seed");
    assert_eq!(fs::read_to_string(format!("{out}/hunt.jsonl")).expect("a log"), log);
    let other = foxhunt(["--json", "hunt", "--seed", "4", "--out", out]).json();
    assert_ne!(other["beacons"][0]["error_m"], beacons[0]["error_m"], "another seed");
}

#[test]
fn a_hunt_from_a_file_ends_with_a_table() {
    let folder = folder("hunt_file");
    let file = folder.join("small.toml");
    fs::write(&file, scenario()).expect("the folder can be written to");
    let (file, out) = (file.to_str().expect("UTF-8"), folder.to_str().expect("UTF-8"));
    let ran = foxhunt(["hunt", file, "--out", out, "--estimator", "particle"]);
    assert_eq!(ran.code, 0, "{ran:?}");
    for text in ["particle, seed 1", "fox", "NEES", "hunt.jsonl", "hunt.svg"] {
        assert!(ran.stdout.contains(text), "{text} is missing in {}", ran.stdout);
    }
    assert!(!ran.stdout.contains("NaN"));
    let own = foxhunt(["hunt", file, "--out", out, "--json"]).json();
    assert_eq!(own["estimator"], "ekf-pritzl2018", "the scenario's own");
}
