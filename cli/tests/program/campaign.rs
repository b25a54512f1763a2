use crate::support::{foxhunt, has};

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
        assert_eq!(beacon["anees_interval"].as_array().map(Vec::len), Some(2));
    }
}

#[test]
fn a_campaign_ends_with_a_table_for_each_beacon() {
    let ran = foxhunt(["campaign", "--runs", "2"]);
    assert_eq!(ran.code, 0, "{ran:?}");
    for text in ["beacon 1", "beacon 2", "ukf-pritzl2018", "p90", "ANEES", "failed"] {
        assert!(ran.stdout.contains(text), "{text} is missing in {}", ran.stdout);
    }
    let row = ran.stdout.lines().find(|line| line.contains("ukf-pritzl2018")).expect("its row");
    let verdicts = ["too few", "over-confident", "under-confident"];
    assert!(verdicts.iter().any(|verdict| row.contains(verdict)), "{row}");
    assert!(!ran.stdout.contains("NaN"));
}
