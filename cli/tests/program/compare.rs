//! Comparisons: estimators on trials, extractors, antennas, planners.

use crate::support::{foxhunt, has};

#[test]
fn a_trial_is_run_like_a_hunt_and_has_checkpoints() {
    let ran = foxhunt([
        "compare",
        "estimators",
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
    let table =
        foxhunt(["compare", "estimators", "isaacs-static", "--runs", "2", "--estimator", "ekf"]);
    for text in ["target", "after 12", "after 24", "whole track", "ekf"] {
        assert!(table.stdout.contains(text), "{text} is missing in {}", table.stdout);
    }
}

#[test]
fn what_does_not_suit_a_trial_is_refused() {
    for (estimator, needs) in [
        ("default", "needs levels"),
        ("ukf-pritzl2018", "needs steps that count receptions"),
        ("imm", "needs a target that moves"),
    ] {
        let args = ["isaacs-static", "--runs", "1", "--estimator", estimator];
        let refused = format!("{estimator} cannot run in isaacs-static");
        foxhunt(["compare", "estimators"].iter().chain(&args)).failed(2, &[&refused, needs]);
    }
    foxhunt(["compare", "estimators", "pritzl-6.1", "--runs", "1"])
        .failed(2, &["is a scenario", "foxhunt campaign pritzl-6.1"]);
    foxhunt(["compare", "estimators", "nothing", "--runs", "1"])
        .failed(2, &["nothing", "isaacs-static", "bot-h"]);
}

#[test]
fn extractors_are_compared_alike_on_any_number_of_jobs() {
    let run = |jobs: &str| {
        foxhunt([
            "compare",
            "extractors",
            "bearing-reflector",
            "--runs",
            "6",
            "--json",
            "--jobs",
            jobs,
        ])
    };
    let one = run("1");
    assert_eq!(one.code, 0, "{one:?}");
    assert_eq!(one.stdout, run("2").stdout);
    let report = one.json();
    has(&report, &["campaign", "runs", "seed", "bound_deg", "extractors"]);
    let extractors = report["extractors"].as_array().expect("a list");
    assert_eq!(extractors.len(), 10);
    for extractor in extractors {
        has(
            extractor,
            &["extractor", "rms_deg", "sigma_ratio", "coverage_95", "refused", "correlation_p"],
        );
    }
    let other = foxhunt(["compare", "extractors", "--runs", "2", "--antenna", "cardioid"]);
    assert!(
        other.stdout.contains("Cramér-Rao bound") && other.stdout.contains("maximum"),
        "{other:?}"
    );
}

#[test]
fn antennas_are_compared_run_by_run() {
    let report = foxhunt([
        "compare",
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
fn the_sigma_of_bearings_is_compared_with_a_constant_one() {
    let args = ["compare", "sigmas", "pritzl-7.4", "--runs", "3", "--estimator", "ukf"];
    let report = foxhunt(["--json"].iter().chain(&args)).json();
    has(&report, &["scenario", "runs", "seed", "estimators"]);
    let campaign = &report["estimators"][0];
    let bearings = &campaign["bearings"];
    has(
        bearings,
        &["bearings", "without", "rms_deg", "correlation", "correlation_p", "hunt_correlation"],
    );
    let turns = ["bearings", "without"].map(|count| bearings[count].as_u64().expect("a number"));
    assert!(turns[0] + turns[1] == 144 && turns[1] < 9, "48 turns in each hunt: {turns:?}");
    // What bends the patterns is in their σ.
    let r = bearings["correlation"].as_f64().expect("a number");
    assert!(r > 0.3 && bearings["correlation_p"].as_f64().is_some_and(|p| p < 1e-3), "{bearings}");
    let setups = campaign["setups"].as_array().expect("a list");
    let names: Vec<_> = setups.iter().map(|setup| setup["setup"].as_str()).collect();
    assert_eq!(names, [Some("own"), Some("fitted"), Some("constant")]);
    // The constant is as large as the errors are, and no bearing has its own share.
    assert_eq!(setups[2]["calibration"]["sigma_floor_deg"], bearings["rms_deg"]);
    assert_eq!(setups[2]["calibration"]["sigma_scale"], 0.0);
    let comparisons = campaign["comparisons"].as_array().expect("a list");
    assert_eq!(comparisons.len(), 2);
    for comparison in comparisons {
        has(comparison, &["beacon", "setup", "ratio", "ratio_interval", "p_value"]);
        assert_eq!(comparison["pairs"], 3, "{comparison}");
    }
    // A constant that is given is used.
    let given = ["--json", "--constant-deg", "20"];
    let report = foxhunt(args.iter().chain(&given)).json();
    let constant = &report["estimators"][0]["setups"][2];
    assert_eq!(constant["calibration"]["sigma_floor_deg"], 20.0);
    let printed = foxhunt(args);
    assert!(printed.stdout.contains("constant") && printed.stdout.contains("Student's"));
    foxhunt(args.iter().chain(&["--constant-deg", "0"])).failed(2, &["--constant-deg is 0"]);
}

#[test]
fn planners_are_compared_with_the_reference_in_their_scenarios() {
    let args = ["compare", "planners", "--runs", "3", "--planner", "hold", "--estimator", "ekf"];
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
    for text in ["far-start, ekf", "3 move limit reached", "over pritzl2018:"] {
        assert!(table.stdout.contains(text), "{text} is missing in {}", table.stdout);
    }
    let table = foxhunt(args.iter().chain(&["--markdown"]));
    for text in ["| scenario ", "| far-start ", "3 move limit reached", "against"] {
        assert!(table.stdout.contains(text), "{text} is missing in {}", table.stdout);
    }
    let two = foxhunt([&args[..], &["--estimator", "grid"]].concat());
    two.failed(2, &["--estimator"]);
    let one =
        foxhunt(["--json", "compare", "planners", "one-drone", "--runs", "1"].iter().chain(&[
            "--planner",
            "hold",
            "--planner",
            "orbit",
            "--estimator",
            "ekf",
        ]));
    let one = one.json();
    assert_eq!(one.as_array().map(Vec::len), Some(1));
    assert_eq!(one[0]["planners"].as_array().map(Vec::len), Some(3));
}

#[test]
fn a_comparison_refuses_what_does_not_fit() {
    for (args, expected) in [
        (&["compare", "extractors", "--estimator", "ekf"][..], "--estimator"),
        (&["compare", "extractors", "--planner", "hold"], "--planner"),
        (&["compare", "extractors", "bearing-magic"], "bearing-reflector"),
        (&["compare", "extractors", "--antenna", "no.msi"], "no.msi"),
        (&["compare", "estimators", "isaacs-static", "--extractor", "maximum"], "--extractor"),
        (&["compare", "estimators", "isaacs-static", "--planner", "hold"], "--planner"),
        (&["compare", "estimators", "isaacs-static", "--calibration", "c.toml"], "--calibration"),
    ] {
        foxhunt(args.iter().chain(&["--runs", "1"])).failed(2, &[expected]);
    }
}
