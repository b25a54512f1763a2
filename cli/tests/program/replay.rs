use std::fs;

use crate::support::{folder, foxhunt, has};

/// A hunt's log in a folder of its own.
fn log(name: &str) -> String {
    let out = folder(name);
    let out = out.to_str().expect("the target folder is UTF-8");
    assert_eq!(foxhunt(["hunt", "--out", out]).code, 0);
    format!("{out}/hunt.jsonl")
}

#[test]
fn a_log_replays_to_the_bit() {
    let log = log("replay_own");
    let report = foxhunt(["replay", "--json", &log]).json();
    has(&report, &["own", "compared", "identical", "beacons", "estimator"]);
    assert_eq!(report["own"], true);
    assert_eq!(report["compared"], report["identical"]);
    let compared = report["compared"].as_u64().expect("a count");
    assert!(compared > 20);
    let table = foxhunt(["replay", &log]);
    let verdict = format!("{compared} of {compared} estimates are identical");
    assert!(table.code == 0 && table.stdout.contains(&verdict), "{table:?}");
    assert!(["ANIS", "verdict", "white p"].iter().all(|t| table.stdout.contains(t)), "{table:?}");
}

#[test]
fn another_estimator_is_compared() {
    let log = log("replay_other");
    let report = foxhunt(["replay", "--json", &log, "--estimator", "ekf"]).json();
    assert_eq!(report["own"], false);
    assert_eq!(report["logged_estimator"], "default");
    assert_eq!(report["estimator"], "ekf");
    let beacon = &report["beacons"][0];
    has(beacon, &["error_m", "logged_error_m", "nees", "steps"]);
    has(beacon, &["anis", "anis_interval", "innovations", "whiteness_p"]);
    let p = beacon["whiteness_p"].as_f64().expect("a probability");
    assert!((0.0..=1.0).contains(&p), "{p}");
    assert_ne!(beacon["error_m"], beacon["logged_error_m"]);
    let table = foxhunt(["replay", &log, "--estimator", "ekf"]);
    assert!(table.stdout.contains("default error m"), "{table:?}");
}

#[test]
fn a_log_that_was_changed_does_not_replay() {
    let log = log("replay_changed");
    let text = fs::read_to_string(&log).expect("it was written");
    let line = text.lines().find(|l| l.contains("\"corrected\"")).expect("something was received");
    let changed = line.replace("\"covariance\":[", "\"covariance\":[1");
    assert_ne!(line, changed);
    fs::write(&log, text.replacen(line, &changed, 1)).expect("it can be written");
    let ran = foxhunt(["replay", &log]);
    assert_eq!(ran.code, 1, "{ran:?}");
    assert!(ran.stderr.contains("1 of "), "{}", ran.stderr);
}

#[test]
fn a_broken_log_is_named_with_its_line() {
    let log = log("replay_broken");
    let text = fs::read_to_string(&log).expect("it was written");
    let mut lines: Vec<&str> = text.lines().collect();
    lines[4] = "{\"event\":\"what\"}";
    fs::write(&log, lines.join("\n") + "\n").expect("it can be written");
    foxhunt(["replay", &log]).failed(2, &["hunt.jsonl, line 5", "what"]);

    // Cut within the last line, as by a crash: what is whole is used.
    let torn = &text[..text.len() - 20];
    fs::write(&log, torn).expect("it can be written");
    let ran = foxhunt(["replay", &log]);
    assert!(ran.code == 0 && ran.stderr.contains("cut short"), "{ran:?}");
}

#[test]
fn struck_receptions_are_left_out() {
    let log = log("replay_ignore");
    let text = fs::read_to_string(&log).expect("it was written");
    let events = text.lines().map(serde_json::from_str::<serde_json::Value>);
    let received: Vec<_> = events
        .map(|event| event.expect("JSON"))
        .filter(|event| event["event"] == "received")
        .collect();
    let list = log.replace("hunt.jsonl", "struck.jsonl");
    let page = log.replace("hunt.jsonl", "without.html");
    let mut lines = "{\"foxhunt_struck\":1}\n".to_owned();
    for event in &received[3..6] {
        let drone = &event["drone"];
        let reception = &event["reception"];
        let beacon = &reception["beacon"];
        let time = &reception["time"];
        lines += &format!("{{\"drone\":{drone},\"beacon\":{beacon},\"time\":{time}}}\n");
    }
    fs::write(&list, &lines).expect("it can be written");
    let all = foxhunt(["replay", "--json", &log]).json();
    let report = foxhunt(["replay", "--json", &log, "--ignore", &list, "--report", &page]).json();
    assert_eq!((&report["ignored"], &report["own"]), (&3.into(), &false.into()));
    let steps = |report: &serde_json::Value| report["beacons"][0]["steps"].as_u64();
    assert_eq!(steps(&report), steps(&all).map(|steps| steps - 3));
    assert_ne!(report["beacons"][0]["estimate"], all["beacons"][0]["estimate"]);
    assert_eq!(report["beacons"][1], all["beacons"][1], "the other beacon's do not change");
    let page = fs::read_to_string(&page).expect("it was written");
    assert_eq!(page.matches("\"struck\":true").count(), 3);
    let table = foxhunt(["replay", &log, "--ignore", &list]);
    assert!(table.stdout.contains("3 receptions left out"), "{table:?}");
    assert!(table.stdout.contains("without them"), "{table:?}");

    fs::write(&list, lines + "{\"drone\":0,\"beacon\":0,\"time\":0.125}\n").expect("it can be");
    let wrong = foxhunt(["replay", &log, "--ignore", &list]);
    wrong.failed(2, &["struck.jsonl, line 5", "time 0.125", "nearest"]);
}

#[test]
fn a_track_is_smoothed() {
    let out = folder("replay_smooth");
    let out = out.to_str().expect("the target folder is UTF-8");
    assert_eq!(foxhunt(["hunt", "isaacs-circle", "--seed", "2", "--out", out]).code, 0);
    let log = format!("{out}/hunt.jsonl");
    let exported = format!("{out}/track.geojson");
    let page = format!("{out}/smoothed.html");
    let origin = ["--origin", "50.0755,14.4378"];
    let written = ["--json", "replay", &log, "--smooth", "--export", &exported, "--report", &page];
    let report = foxhunt([&written[..], &origin].concat()).json();
    assert_eq!((&report["own"], &report["compared"]), (&true.into(), &report["identical"]));
    let smoothed = &report["beacons"][0]["smoothed"];
    let places = smoothed["places"].as_array().expect("a list");
    assert_eq!(
        Some(u64::try_from(places.len()).expect("few")),
        report["beacons"][0]["steps"].as_u64()
    );
    has(&places[0], &["time_s", "estimate", "ellipse_95", "error_m"]);
    let [before, after] = ["filtered_rms_error_m", "rms_error_m"]
        .map(|key| smoothed[key].as_f64().expect("the truth is known"));
    assert!(after < 0.9 * before, "{after} m, {before} m before");
    let text = fs::read_to_string(&exported).expect("it was written");
    assert!(text.contains("smoothed-track"));
    let text = fs::read_to_string(&page).expect("it was written");
    assert!(text.contains("\"smoothed\":[{"));
    let table = foxhunt(["replay", &log, "--smooth"]);
    assert!(table.code == 0 && table.stdout.contains("smoothed rms m"), "{table:?}");
    let table = foxhunt(["replay", &log]);
    assert!(!table.stdout.contains("smoothed"), "{table:?}");
}

#[test]
fn an_estimator_without_a_smoother_is_refused_by_name() {
    let log = log("replay_unsmoothed");
    foxhunt(["replay", &log, "--smooth"])
        .failed(2, &["hunt.jsonl", "\"default\"", "beacon", "more than a place is not supported"]);
    let batch = ["replay", &log, "--smooth", "--estimator", "batch"];
    foxhunt(batch).failed(2, &["\"batch\"", "smoothing a batch is not supported"]);
}
