//! Planners: the list and the choice.

use crate::support::{folder, foxhunt, has};

#[test]
fn the_list_names_each_with_its_source() {
    let listed = foxhunt(["planners", "--json"]).json();
    let listed = listed.as_array().expect("a list");
    for planner in listed {
        has(planner, &["name", "about", "source"]);
    }
    let table = foxhunt(["planners"]).stdout;
    for name in ["pritzl2018", "waypoints", "hold"] {
        assert!(listed.iter().any(|planner| planner["name"] == name), "{name}");
        assert!(table.contains(name), "{name} is missing in {table}");
    }
}

#[test]
fn a_hunt_flies_with_the_planner_that_is_asked_for() {
    let out = folder("planner");
    let hunt = |more: &[&str]| {
        let args = ["hunt", "--json", "--estimator", "ekf-pritzl2018", "--out"];
        let out = out.to_str().expect("a name");
        foxhunt(args.into_iter().chain([out]).chain(more.iter().copied())).json()
    };
    let held = hunt(&["--planner", "hold"]);
    assert_eq!(held["beacons"][0]["outcome"], "move_limit");
    assert_eq!(hunt(&["--planner", "waypoints"])["beacons"][0]["outcome"], "path_done");
    assert_eq!(held["planner"], "hold");
    // What pritzl-6.1 flies with is the reference's planner.
    let (own, named) = (hunt(&[]), hunt(&["--planner", "pritzl2018"]));
    assert_eq!(own["beacons"], named["beacons"]);
    assert_eq!(
        (&own["planner"], &named["planner"]),
        (&"scenario's own".into(), &"pritzl2018".into())
    );
}

#[test]
fn a_campaign_flies_with_it_and_trials_refuse_it() {
    let args = ["campaign", "--runs", "1", "--json", "--estimator", "ekf-pritzl2018", "--planner"];
    let campaign = |name| foxhunt(args.into_iter().chain([name])).json();
    let steps = |report: serde_json::Value| {
        report["estimators"][0]["beacons"][0]["steps"]["mean"].as_f64().expect("a number")
    };
    // Ten turns of three drones.
    assert!((steps(campaign("hold")) - 30.0).abs() < 1e-9);
    foxhunt(["hunt", "--planner", "psychic"]).failed(2, &["psychic", "pritzl2018", "hold"]);
    for name in ["isaacs-static", "bearing-clean"] {
        foxhunt(["campaign", name, "--runs", "1", "--planner", "hold"]).failed(2, &["planner"]);
    }
}
