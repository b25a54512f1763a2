use approx::assert_abs_diff_eq;
use std::{ffi::OsString, fs};

use serde_json::Value;

use crate::support::{folder, foxhunt, has};

#[test]
fn a_name_may_be_a_trial_and_a_scenario() {
    let fixed = ["isaacs-line", "--runs", "2", "--jobs", "1"];
    let run = |command: &[&str]| foxhunt([command, &fixed[..]].concat());
    let drawn = run(&["--json", "compare", "estimators"]).json();
    let flown = run(&["--json", "campaign"]);
    assert!(flown.stderr.contains("foxhunt compare estimators isaacs-line"), "{flown:?}");
    let flown = flown.json();
    let beacon = |report: &serde_json::Value| report["estimators"][0]["beacons"][0].clone();
    assert_eq!(flown["estimators"][0]["estimator"], "particle-bearing");
    assert_eq!(beacon(&drawn)["name"], "target");
    assert_eq!(beacon(&flown)["name"], "source");
    // As many turns as the path has places, whatever is received.
    assert_eq!(beacon(&flown)["steps"]["mean"], 32.0);
    assert!(beacon(&flown)["error_m"]["max"].as_f64().expect("a number") < 3.0);
}

#[test]
fn quadrotors_fly_by_either_dynamics() {
    let fly = |scenario: &str, dynamics: &str| {
        let fixed = ["--json", "campaign", scenario, "--runs", "1", "--dynamics", dynamics];
        foxhunt(fixed)
    };
    let error = |dynamics: &str| {
        let report = fly("isaacs-static", dynamics).json();
        report["estimators"][0]["beacons"][0]["error_m"]["p50"].as_f64().expect("a number")
    };
    let simplified = error("isaacs2014");
    let rigid = error("rigid-body");
    assert!(simplified < 1.0 && rigid < 1.0, "{simplified} and {rigid}");
    assert_ne!(simplified.to_bits(), rigid.to_bits(), "the body makes no difference");
    let refused = fly("pritzl-6.1", "rigid-body");
    assert_ne!(refused.code, 0);
    assert!(refused.stderr.contains("the drones of pritzl-6.1 are no quadrotors"), "{refused:?}");
}

#[test]
fn a_campaign_is_the_same_for_any_number_of_jobs() {
    let fly = |jobs: &str| {
        let mut args = vec!["campaign", "--json", "--runs", "3", "--jobs", jobs];
        args.extend(["--estimator", "ukf-pritzl2018", "--estimator", "ekf-pritzl2018"]);
        foxhunt(args)
    };
    let one = fly("1");
    assert_eq!(one.stdout, fly("2").stdout);
    assert!(!one.stderr.contains("hunts"), "progress is for terminals: {}", one.stderr);

    let report = one.json();
    has(&report, &["scenario", "runs", "estimators"]);
    assert_eq!(report["runs"], 3);
    let estimators = report["estimators"].as_array().expect("a list");
    let names: Vec<_> = estimators.iter().map(|e| e["estimator"].as_str()).collect();
    assert_eq!(names, [Some("ukf-pritzl2018"), Some("ekf-pritzl2018")]);
    for beacon in estimators.iter().flat_map(|e| e["beacons"].as_array().expect("a list")) {
        has(
            beacon,
            &[
                "name",
                "error_m",
                "steps",
                "anees",
                "anees_interval",
                "verdict",
                "coverage_95",
                "coverage_95_interval",
                "anis",
                "anis_interval",
                "failed",
            ],
        );
        has(&beacon["error_m"], &["p10", "p50", "p90", "mean", "rms", "max"]);
        has(&beacon["steps"], &["mean", "p10", "p50", "p90"]);
        for first_passage in ["steps_to_3m", "time_to_3m_s"] {
            has(&beacon[first_passage], &["p10", "p50", "p90", "never"]);
        }
        assert!(beacon["steps_to_3m"]["never"].as_u64().expect("a number") <= 3);
        assert!(beacon["path_m"]["p10"].as_f64().expect("a number") > 10.0);
        assert_eq!(beacon["anees_interval"].as_array().map(Vec::len), Some(2));
    }
}

#[test]
fn every_hunt_of_a_campaign_may_be_kept() {
    let file = folder("every_hunt").join("hunts.jsonl");
    let args = ["campaign", "--json", "--runs", "3", "--seed", "5", "--planner", "hold"];
    let estimators = ["--estimator", "ukf-pritzl2018", "--estimator", "ekf-pritzl2018"];
    let mut args: Vec<OsString> = args.iter().chain(&estimators).map(OsString::from).collect();
    args.extend(["--hunts-to".into(), file.clone().into_os_string()]);
    let report = foxhunt(args).json();
    let lines = fs::read_to_string(&file).expect("it was written");
    let hunts: Vec<Value> = lines
        .lines()
        .map(|line| serde_json::from_str(line).expect("a JSON value in each line"))
        .collect();
    let seeds: Vec<_> = hunts.iter().filter_map(|hunt| hunt["seed"].as_u64()).collect();
    assert_eq!(seeds, [5, 6, 7, 5, 6, 7]);
    assert!(hunts.iter().all(|hunt| hunt["planner"] == "hold"));
    for (estimator, hunts) in hunts.chunks(3).enumerate() {
        let estimator = &report["estimators"][estimator];
        assert!(hunts.iter().all(|hunt| hunt["estimator"] == estimator["estimator"]));
        let error = |hunt: &Value| hunt["beacons"][0]["error_m"].as_f64().expect("a number");
        let mean = hunts.iter().map(error).sum::<f64>() / 3.0;
        let reported = estimator["beacons"][0]["error_m"]["mean"].as_f64().expect("a number");
        assert_abs_diff_eq!(mean, reported, epsilon = 1e-9);
    }
    foxhunt(["campaign", "--runs", "1", "--hunts-to", "/no/such/folder/x"])
        .failed(1, &["/no/such/folder/x"]);
}

#[test]
fn long_work_is_streamed_as_lines_of_json() {
    let lines = |args: &[&str]| -> Vec<Value> {
        let ran = foxhunt([&["--json=lines"], args].concat());
        assert_eq!(ran.code, 0, "{ran:?}");
        let value = |line: &str| serde_json::from_str(line).expect("a JSON value in each line");
        ran.stdout.lines().map(value).collect()
    };
    let of = |lines: &[Value], kind: &str| -> Vec<Value> {
        let fitting = lines.iter().filter(|line| line["kind"] == kind);
        fitting.map(|line| line["value"].clone()).collect()
    };
    let args = ["campaign", "--runs", "3", "--seed", "5", "--estimator", "ekf-pritzl2018"];
    let streamed = lines(&args);
    let seeds: Vec<_> = of(&streamed, "hunt").iter().map(|hunt| hunt["seed"].clone()).collect();
    assert_eq!(seeds, [5, 6, 7]);
    let mut done: Vec<_> = of(&streamed, "progress")
        .iter()
        .map(|p| (p["done"].as_u64(), p["total"].as_u64()))
        .collect();
    done.sort_unstable();
    assert_eq!(done, [1, 2, 3].map(|done| (Some(done), Some(3))));
    // The last line is what `--json` alone prints.
    let whole = foxhunt(["--json"].iter().chain(&args)).json();
    assert_eq!(
        streamed.last().map(|line| (&line["kind"], &line["value"])),
        Some((&"result".into(), &whole))
    );

    let out = folder("streamed_soak");
    let out = out.to_str().expect("UTF-8");
    let soak = lines(&["soak", "--runs", "4", "--jobs", "1", "--out", out]);
    assert_eq!(of(&soak, "progress").last().map(|p| p["done"].as_u64()), Some(Some(4)));
    let fly = lines(&["fly", "--emulate", "pritzl-6.1", "--out", out]);
    let events = of(&fly, "event");
    let log = fs::read_to_string(format!("{out}/fly-1.jsonl")).expect("a log");
    let logged: Vec<Value> =
        log.lines().skip(1).map(|line| serde_json::from_str(line).expect("an event")).collect();
    assert!(events.len() > 20 && events == logged, "{} and {}", events.len(), logged.len());
}

#[test]
fn a_campaign_ends_with_a_table_for_each_beacon() {
    let ran = foxhunt(["campaign", "--runs", "2"]);
    assert_eq!(ran.code, 0, "{ran:?}");
    for text in ["beacon 1", "beacon 2", "default", "p90", "to 3 m", "path m", "ANEES", "failed"] {
        assert!(ran.stdout.contains(text), "{text} is missing in {}", ran.stdout);
    }
    let mut rows = ran.stdout.lines().filter(|line| line.contains("default"));
    let verdicts = ["too few", "over-confident", "under-confident"];
    let judged = |row: &str| verdicts.iter().any(|verdict| row.contains(verdict));
    assert!(rows.any(judged), "{}", ran.stdout);
    assert!(!ran.stdout.contains("NaN"));
}

#[test]
fn a_campaign_flies_with_the_planner_that_is_given() {
    let args = ["campaign", "--runs", "1", "--json", "--estimator", "ekf-pritzl2018", "--planner"];
    let campaign = |name| foxhunt(args.into_iter().chain([name])).json();
    let steps = |report: serde_json::Value| {
        report["estimators"][0]["beacons"][0]["steps"]["mean"].as_f64().expect("a number")
    };
    // Ten turns of three drones.
    assert_abs_diff_eq!(steps(campaign("hold")), 30.0, epsilon = 1e-9);
    foxhunt(["hunt", "--planner", "psychic"]).failed(2, &["psychic", "pritzl2018", "hold"]);
}

#[test]
fn overrides_change_settings_and_are_refused_where_there_are_none() {
    let campaign = |more: &[&str]| {
        let args = ["campaign", "--runs", "2", "--json", "--estimator", "ekf"];
        foxhunt([&args[..], more].concat())
    };
    let both = campaign(&[]).json();
    let rss = campaign(&["--components", "rss"]).json();
    assert_ne!(both["estimators"], rss["estimators"]);
    let own = ["hunt", "--estimator", "range-difference", "--lag-s", "5"];
    foxhunt(own).failed(2, &["range-difference has no setting --lag-s"]);
}

#[test]
fn random_fleets_are_checked_against_the_rules() {
    let args = ["fleets", "--runs", "4", "--seed", "3"];
    let report = foxhunt(["--json"].iter().chain(&args)).json();
    has(&report, &["runs", "seed", "outcomes", "errors", "duration_s", "stranded", "violations"]);
    has(&report, &["spare_separation_m", "spare_airspace_m", "spare_endurance_s"]);
    assert_eq!((&report["runs"], &report["seed"]), (&4.into(), &3.into()));
    assert_eq!(report["violations"], serde_json::json!([]));
    let ends = report["outcomes"].as_array().expect("a list").iter();
    assert!(ends.map(|end| end["runs"].as_u64().expect("a number")).sum::<u64>() >= 4);
    let printed = foxhunt(args);
    for text in ["4 random fleets, seeds from 3", "separation", "how it ended", "No violation."] {
        assert!(printed.stdout.contains(text), "{text} is missing in {}", printed.stdout);
    }
    foxhunt([&args[..], &["--prior-sigma-m", "3"]].concat()).failed(2, &["--prior-sigma-m"]);
    // Each of them is a scenario of its own.
    let out = crate::support::folder("fleet");
    let out = out.to_str().expect("UTF-8");
    let hunt = foxhunt(["--json", "hunt", "fleet-4", "--seed", "4", "--out", out]).json();
    has(&hunt, &["seed", "beacons"]);
}

#[test]
fn a_short_soak_finds_nothing() {
    let out = crate::support::folder("soak");
    let out = out.to_str().expect("UTF-8");
    let report = foxhunt(["--json", "soak", "--runs", "24", "--seed", "1", "--out", out]).json();
    has(&report, &["searches", "estimates", "log_bytes", "read", "located", "refused"]);
    assert_eq!((&report["flights"], &report["recordings"]), (&15.into(), &6.into()));
    assert_eq!(report["device_flights"], 3);
    assert!(report["replayed"].as_u64() > Some(100), "{report}");
    assert_eq!(report["failures"], serde_json::json!([]));
    // One flight by its file, as a failure leaves it.
    let again = foxhunt(["soak", "--again", "fleet-3", "--seed", "3"]);
    assert!(again.code == 0 && again.stdout.contains("estimates replayed"), "{again:?}");
    let recording = format!("{out}/4.csv");
    fs::create_dir_all(out).expect("a folder");
    fs::write(&recording, "time_s,east_m,north_m,bearing_deg_compass\n0,1,2,30\n").expect("a file");
    let again = foxhunt(["--json", "soak", "--again", &recording, "--seed", "4"]).json();
    assert_eq!((&again["recordings"], &again["read"]), (&1.into(), &1.into()), "{again}");
    foxhunt(["soak", "--again", "no.csv"]).failed(1, &["no.csv"]);
    foxhunt(["soak"]).failed(2, &["--hours", "--runs"]);
    foxhunt(["soak", "--hours", "-1"]).failed(2, &["--hours"]);
}

/// Scores of a class, without the times.
fn scores(report: &Value) -> Vec<Value> {
    let of_class = |class: &Value| {
        let estimators = class["estimators"].as_array().expect("a list").iter();
        let own = std::iter::once(&class["default"]).chain(estimators);
        let scores = own.map(|row| (row["scores"].clone(), row["remarks"].clone()));
        serde_json::json!([class["class"], class["bound_m"], scores.collect::<Vec<_>>()])
    };
    report["classes"].as_array().expect("a list").iter().map(of_class).collect()
}

#[test]
fn drawn_recordings_are_judged_alike_on_any_number_of_threads() {
    let classes = "few-nodes,bearings,bearings-diverge,hover,ranges,differences-two,comma";
    let judge = |jobs: &str| {
        let args = ["--json", "soak", "--recordings", "--runs", "3", "--seed", "5"];
        foxhunt([&args[..], &["--jobs", jobs, "--class", classes]].concat()).json()
    };
    let report = judge("1");
    assert_eq!(scores(&report), scores(&judge("2")));
    let of = |name: &str| {
        let all = report["classes"].as_array().expect("a list");
        all.iter().find(|class| class["class"] == name).expect("it was drawn").clone()
    };
    for name in classes.split(',') {
        let class = of(name);
        has(&class, &["about", "bound_m", "most_memory_mib", "default", "estimators"]);
        let scores = &class["default"]["scores"];
        has(scores, &["median_error_m", "median_interval_m", "mean_log_score", "in_regions_95"]);
        assert_eq!(scores["fixes"].as_u64().map(|fixes| fixes > 3), Some(false), "{class}");
    }
    let lost = |name: &str| of(name)["lost"].as_array().expect("a list").clone();
    assert!(!lost("comma").contains(&"refused".into()), "{}", of("comma"));
    assert_eq!(lost("hover"), [] as [Value; 0], "a refusal is right where the place is open");
    // The best that can be done stands beside what was done.
    assert!(of("bearings")["bound_m"].as_f64().expect("a number") > 1.0);
    assert!(of("comma")["bound_m"].is_null(), "the law of its levels is not that of the bound");
    let names = |class: &Value| -> Vec<String> {
        let rows = class["estimators"].as_array().expect("a list").iter();
        rows.map(|row| row["scores"]["estimator"].as_str().expect("a name").to_owned()).collect()
    };
    let expected = ["bearing-grid", "lenth1981", "lenth1981-andrews", "pseudolinear"];
    assert!(expected.iter().all(|name| names(&of("bearings")).iter().any(|own| own == name)));
    assert_eq!(report["skipped"], serde_json::json!([]));
}

#[test]
fn the_worst_draws_are_written_with_a_command_that_shows_them() {
    let out = folder("worst");
    let out = out.to_str().expect("UTF-8");
    let args =
        ["--json", "soak", "--recordings", "--runs", "4", "--class", "differences-two,comma"];
    let report = foxhunt([&args[..], &["--write", out]].concat()).json();
    for worst in report["worst"].as_array().expect("a list") {
        let of = |key: &str| worst[key].as_str().expect("a text").to_owned();
        let [least, rows] = [&worst["least"][0], &worst["least"][1]];
        assert!(rows[0].as_u64() <= rows[1].as_u64(), "{worst}");
        for command in [of("command"), least.as_str().expect("a command").to_owned()] {
            let words: Vec<OsString> = command.split(' ').skip(1).map(OsString::from).collect();
            let shown = foxhunt(words);
            assert!(shown.code == 0 || of("what").contains("refused"), "{command}: {shown:?}");
        }
        let again: Vec<OsString> = of("again").split(' ').skip(1).map(OsString::from).collect();
        let again = foxhunt([vec![OsString::from("--json")], again].concat()).json();
        assert_eq!(again["worst"][0]["what"], worst["what"]);
    }
}

#[test]
fn classes_of_recordings_are_named_and_real_ones_need_their_folder() {
    let soak = |args: &[&str]| foxhunt([&["soak", "--recordings"], args].concat());
    soak(&["--runs", "1", "--class", "no-such"]).failed(2, &["no-such", "lanes-white", "otter"]);
    soak(&["--runs", "1", "--data", "no-such-folder"]).failed(2, &["no-such-folder"]);
    soak(&["--hours", "1"]).failed(2, &["--runs"]);
    soak(&["--runs", "1", "--against", "no-such"]).failed(2, &["no-such"]);
    foxhunt(["soak", "--runs", "1", "--class", "lanes"]).failed(2, &["--recordings"]);
    let left = soak(&["--runs", "1", "--class", "otter,bearings-place", "--json"]);
    assert!(left.stderr.contains("FOXHUNT_DATA"), "{left:?}");
    assert_eq!(left.json()["skipped"], serde_json::json!(["otter"]));
}
