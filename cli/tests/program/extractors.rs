//! Extractors: the list, the choice, the comparison.

use crate::support::{foxhunt, has};

#[test]
fn the_list_names_the_recommended_one() {
    let listed = foxhunt(["extractors", "--json"]).json();
    let listed = listed.as_array().expect("a list");
    assert!(listed.len() >= 9);
    has(&listed[0], &["name", "about", "source", "needs_antenna", "recommended"]);
    let recommended: Vec<_> = listed.iter().filter(|e| e["recommended"] == true).collect();
    assert_eq!(recommended.len(), 1);
    assert_eq!(recommended[0]["needs_antenna"], true);
    let table = foxhunt(["extractors"]).stdout;
    assert!(table.contains("pritzl2018") && table.contains("first-harmonic-db"), "{table}");
}

#[test]
fn extractors_are_compared_alike_on_any_number_of_jobs() {
    let run = |jobs: &str| {
        foxhunt(["campaign", "bearing-reflector", "--runs", "6", "--json", "--jobs", jobs])
    };
    let one = run("1");
    assert_eq!(one.code, 0, "{one:?}");
    assert_eq!(one.stdout, run("2").stdout);
    let report = one.json();
    has(&report, &["campaign", "runs", "seed", "bound_deg", "extractors"]);
    let extractors = report["extractors"].as_array().expect("a list");
    assert_eq!(extractors.len(), 9);
    for extractor in extractors {
        has(
            extractor,
            &["extractor", "rms_deg", "sigma_ratio", "coverage_95", "refused", "correlation_p"],
        );
    }
    let other = foxhunt(["campaign", "bearing-clean", "--runs", "2", "--antenna", "cardioid"]);
    assert!(
        other.stdout.contains("Cramér-Rao bound") && other.stdout.contains("maximum"),
        "{other:?}"
    );
}

#[test]
fn a_hunt_flies_with_the_extractor_that_is_asked_for() {
    let dir = std::env::temp_dir().join(format!("foxhunt-extractor-{}", std::process::id()));
    let out = dir.to_str().expect("a name");
    let hunt = |extractor: &str| {
        let estimator = ["--estimator", "ekf-pritzl2018"];
        let args = ["hunt", "--json", "--extractor", extractor, "--out", out];
        let ran = foxhunt(args.into_iter().chain(estimator));
        assert_eq!(ran.code, 0, "{ran:?}");
        ran.stdout
    };
    assert_ne!(hunt("pritzl2018"), hunt("maximum"));
    std::fs::remove_dir_all(&dir).expect("it is there");
}

#[test]
fn wrong_extractors_and_antennas_are_refused() {
    for (args, expected) in [
        (vec!["hunt", "--extractor", "magic"], "magic"),
        (vec!["campaign", "bearing-clean", "--runs", "1", "--estimator", "ekf"], "compares"),
        (vec!["campaign", "bearing-clean", "--runs", "1", "--antenna", "no.msi"], "no.msi"),
        (vec!["hunt", "--antenna", "dipole"], "--antenna"),
        (vec!["campaign", "isaacs-static", "--runs", "1", "--extractor", "maximum"], "--extractor"),
        (vec!["bearing", "x.csv", "--all", "--extractor", "maximum"], "--all"),
    ] {
        let ran = foxhunt(args.clone());
        assert_eq!(ran.code, 2, "{args:?}: {ran:?}");
        assert!(ran.stdout.is_empty() && ran.stderr.contains(expected), "{args:?}: {ran:?}");
    }
}
