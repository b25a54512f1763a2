use crate::support::{foxhunt, has};

#[test]
fn a_trial_that_flies_as_well_is_told_to() {
    let run = |flags: &[&str]| {
        let fixed = ["--json", "campaign", "isaacs-line", "--runs", "2", "--jobs", "1"];
        foxhunt([&fixed[..], flags].concat()).json()
    };
    let (drawn, flown) = (run(&[]), run(&["--flown"]));
    let beacon = |report: &serde_json::Value| report["estimators"][0]["beacons"][0].clone();
    assert_eq!(drawn["estimators"][0]["estimator"], "particle");
    assert_eq!(flown["estimators"][0]["estimator"], "particle-bearing");
    assert_eq!(beacon(&drawn)["name"], "target");
    assert_eq!(beacon(&flown)["name"], "source");
    // As many turns as the path has places, whatever is heard.
    assert_eq!(beacon(&flown)["steps"]["mean"], 32.0);
    assert!(beacon(&flown)["error_m"]["max"].as_f64().expect("a number") < 3.0);
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
    assert!(one.stderr.contains("6 of 6 hunts"), "progress as lines: {}", one.stderr);

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
fn a_campaign_ends_with_a_table_for_each_beacon() {
    let ran = foxhunt(["campaign", "--runs", "2"]);
    assert_eq!(ran.code, 0, "{ran:?}");
    for text in ["beacon 1", "beacon 2", "default", "p90", "to 3 m", "path m", "ANEES", "failed"] {
        assert!(ran.stdout.contains(text), "{text} is missing in {}", ran.stdout);
    }
    let row = ran.stdout.lines().find(|line| line.contains("default")).expect("its row");
    let verdicts = ["too few", "over-confident", "under-confident"];
    assert!(verdicts.iter().any(|verdict| row.contains(verdict)), "{row}");
    assert!(!ran.stdout.contains("NaN"));
}

#[test]
fn a_trial_is_run_like_a_hunt_and_tells_its_checkpoints() {
    let ran = foxhunt([
        "campaign",
        "isaacs-static",
        "--json",
        "--runs",
        "2",
        "--seed",
        "4",
        "--estimator",
        "gaussian-sum",
        "--estimator",
        "ekf",
    ]);
    let report = ran.json();
    assert_eq!((&report["scenario"], &report["seed"]), (&"isaacs-static".into(), &4.into()));
    for estimator in report["estimators"].as_array().expect("a list") {
        let beacon = &estimator["beacons"][0];
        has(beacon, &["error_m", "steps", "anees", "coverage_95", "track_rms_m", "checkpoints"]);
        let after: Vec<_> = beacon["checkpoints"]
            .as_array()
            .expect("a list")
            .iter()
            .map(|point| point["measurements"].as_u64())
            .collect();
        assert_eq!(after, [Some(12), Some(24)]);
        has(&beacon["checkpoints"][0], &["error_m", "anees"]);
    }
    let table = foxhunt(["campaign", "isaacs-static", "--runs", "2", "--estimator", "ekf"]);
    for text in ["target", "after 12", "after 24", "whole track", "ekf"] {
        assert!(table.stdout.contains(text), "{text} is missing in {}", table.stdout);
    }
}

#[test]
fn what_does_not_suit_a_trial_is_refused() {
    for (scenario, estimator, told) in [
        ("isaacs-static", "range-parameterised", "needs a prior of ranging"),
        ("isaacs-static", "ukf-pritzl2018", "no estimator of trials"),
    ] {
        let ran = foxhunt(["campaign", scenario, "--runs", "1", "--estimator", estimator]);
        assert_eq!(ran.code, 2, "{ran:?}");
        assert!(ran.stderr.contains(told), "{}", ran.stderr);
    }
}

#[test]
fn antennas_are_compared_run_by_run() {
    let report = foxhunt([
        "campaign",
        "antennas",
        "--json",
        "--runs",
        "4",
        "--estimator",
        "ekf",
        "--estimator",
        "grid",
    ]);
    let report = report.json();
    has(&report, &["scenario", "runs", "seed", "setups", "comparisons"]);
    let setups = report["setups"].as_array().expect("a list");
    let names: Vec<_> = setups.iter().map(|setup| setup["setup"].as_str()).collect();
    assert_eq!(names, [Some("omnidirectional"), Some("rotating-body"), Some("rotating-antenna")]);
    for setup in setups {
        let estimators = setup["estimators"].as_array().expect("a list");
        assert_eq!(estimators.len(), 2);
        for beacon in estimators.iter().flat_map(|e| e["beacons"].as_array().expect("a list")) {
            assert_eq!(beacon["failed"], 0, "{}", setup["setup"]);
        }
    }
    // Three pairs of antennas, two beacons, two estimators.
    let comparisons = report["comparisons"].as_array().expect("a list");
    assert_eq!(comparisons.len(), 12);
    for comparison in comparisons {
        has(comparison, &["estimator", "beacon", "setup", "against", "pairs", "p_value"]);
        let interval = &comparison["ratio_interval"];
        let [low, high] = [0, 1].map(|i| interval[i].as_f64().expect("a number"));
        let ratio = comparison["ratio"].as_f64().expect("a number");
        assert!(low < ratio && ratio < high && comparison["pairs"] == 4, "{comparison}");
    }
}

#[test]
fn planners_are_compared_with_the_reference_in_their_scenarios() {
    let args = ["campaign", "planners", "--runs", "3", "--planner", "hold", "--estimator", "ekf"];
    let report = foxhunt(["--json"].iter().chain(&args)).json();
    let scenarios = report.as_array().expect("a list");
    let names: Vec<_> = scenarios.iter().map(|s| s["scenario"].as_str().expect("text")).collect();
    assert_eq!(names, ["pritzl-6.1", "far-start", "three-beacons", "one-drone"]);
    for scenario in scenarios {
        has(scenario, &["scenario", "estimator", "runs", "seed", "planners", "comparisons"]);
        assert_eq!(scenario["estimator"], "ekf");
        let planners = scenario["planners"].as_array().expect("a list");
        let names: Vec<_> = planners.iter().map(|p| p["planner"].as_str()).collect();
        assert_eq!(names, [Some("pritzl2018"), Some("hold")]);
        for planner in planners {
            for beacon in planner["beacons"].as_array().expect("a list") {
                has(beacon, &["name", "steps_to_3m", "time_to_3m_s", "path_m", "anees"]);
                let ends = beacon["outcomes"].as_array().expect("a list").iter();
                let ended: u64 = ends.map(|end| end["runs"].as_u64().expect("a number")).sum();
                assert_eq!(ended, 3, "{}: {beacon}", scenario["scenario"]);
            }
        }
        let hold = &planners[1]["beacons"][0];
        assert_eq!(hold["path_m"]["max"], 0.0);
        for comparison in scenario["comparisons"].as_array().expect("a list") {
            assert_eq!(
                (&comparison["planner"], &comparison["against"]),
                (&"hold".into(), &"pritzl2018".into())
            );
            assert_eq!(comparison["path_m"], serde_json::Value::Null, "0 m have no logarithm");
            assert!(comparison["error_m"]["ratio"].as_f64().expect("a number") > 0.1);
        }
    }
    let table = foxhunt(args);
    for text in ["| scenario ", "| far-start ", "3 move limit reached", "against"] {
        assert!(table.stdout.contains(text), "{text} is missing in {}", table.stdout);
    }
    let two = foxhunt([&args[..], &["--estimator", "grid"]].concat());
    two.failed(2, &["one --estimator"]);
}

#[test]
fn random_fleets_are_held_against_what_they_must_keep() {
    let args = ["campaign", "fleets", "--runs", "4", "--seed", "3"];
    let report = foxhunt(["--json"].iter().chain(&args)).json();
    has(&report, &["runs", "seed", "outcomes", "errors", "duration_s", "stranded", "violations"]);
    has(&report, &["spare_separation_m", "spare_airspace_m", "spare_endurance_s"]);
    assert_eq!((&report["runs"], &report["seed"]), (&4.into(), &3.into()));
    assert_eq!(report["violations"], serde_json::json!([]));
    let ends = report["outcomes"].as_array().expect("a list").iter();
    assert!(ends.map(|end| end["runs"].as_u64().expect("a number")).sum::<u64>() >= 4);
    let told = foxhunt(args);
    for text in ["4 random fleets, seeds from 3", "separation", "how it ended", "No violation."] {
        assert!(told.stdout.contains(text), "{text} is missing in {}", told.stdout);
    }
    foxhunt([&args[..], &["--prior-sigma-m", "3"]].concat()).failed(2, &["drawn at random"]);
    // Each of them is a scenario of its own.
    let out = crate::support::folder("fleet");
    let out = out.to_str().expect("UTF-8");
    let hunt = foxhunt(["--json", "hunt", "fleet-4", "--seed", "4", "--out", out]).json();
    has(&hunt, &["seed", "beacons"]);
}
