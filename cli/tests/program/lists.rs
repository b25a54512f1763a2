//! `list`: names and descriptions.

use serde_json::Value;

use crate::support::{foxhunt, has};

/// A list as JSON, and as a table.
fn list(what: &str) -> (Vec<Value>, String) {
    let listed = foxhunt(["list", what, "--json"]).json();
    // Every estimator; what is not in the menu has a test of its own.
    let all = (what == "estimators").then_some("--all");
    let table = foxhunt(["list", what].into_iter().chain(all));
    assert_eq!(table.code, 0, "{table:?}");
    (listed.as_array().expect("a list").clone(), table.stdout)
}

#[test]
fn every_list_is_a_table_or_json() {
    let lists =
        ["scenarios", "trials", "estimators", "extractors", "planners", "sources", "cases", "keys"];
    for what in lists {
        let (listed, table) = list(what);
        assert!(!listed.is_empty(), "{what}");
        for entry in &listed {
            let name = entry["name"].as_str().expect("a name");
            // A name is never wrapped.
            assert!(table.contains(name), "{name} is missing in {table}");
        }
    }
}

#[test]
fn scenarios_have_a_default_and_are_no_trials() {
    let (listed, _) = list("scenarios");
    let default: Vec<_> = listed.iter().filter(|s| s["default"] == true).collect();
    assert_eq!(default.len(), 1);
    assert_eq!(default[0]["name"], "pritzl-6.1");
    let (trials, _) = list("trials");
    assert!(trials.iter().any(|trial| trial["name"] == "bot-m"));
    assert!(!listed.iter().any(|scenario| scenario["name"] == "bot-m"));
}

#[test]
fn estimators_have_what_they_work_on() {
    let (listed, table) = list("estimators");
    let fields = [
        "name",
        "about",
        "source",
        "in_menu",
        "when",
        "level",
        "bearing",
        "others",
        "moving",
        "all_at_once",
    ];
    has(&listed[0], &fields);
    let of = |name: &str| {
        listed.iter().find(|entry| entry["name"] == name).unwrap_or_else(|| panic!("{name}"))
    };
    for name in ["shadowing-grid", "lenth1981", "field-map", "batch-multistart"] {
        assert_eq!(of(name)["all_at_once"], true, "{name}");
    }
    assert_eq!(of("batch")["all_at_once"], false);
    assert_eq!(of("particle-bearing")["level"], "unused");
    assert_eq!(of("particle-bearing-moving")["moving"], true);
    assert_eq!(of("range-difference")["others"][0], "range_difference_m");
    for column in ["level", "bearing", "others", "moving", "takes", "source"] {
        assert!(table.contains(column), "{column}");
    }
}

#[test]
fn the_menu_of_estimators_says_when_to_use_which() {
    let (listed, _) = list("estimators");
    let menu = foxhunt(["list", "estimators"]).stdout;
    let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let printed = words(&menu);
    assert!(menu.contains("when to use it") && menu.contains("list estimators --all"), "{menu}");
    for entry in &listed {
        let name = entry["name"].as_str().expect("a name");
        let in_menu = entry["in_menu"].as_bool().expect("true or false");
        assert_eq!(entry["when"].is_string(), in_menu, "{name}");
        assert_eq!(printed.iter().any(|word| word == name), in_menu, "{name}: {menu}");
    }
    assert_eq!(listed.iter().filter(|entry| entry["in_menu"] == true).count(), 22);
    foxhunt(["list", "planners", "--all"]).failed(2, &["--all", "estimators"]);
}

#[test]
fn one_extractor_is_recommended() {
    let (listed, _) = list("extractors");
    assert!(listed.len() >= 9);
    has(&listed[0], &["name", "about", "source", "needs_antenna", "recommended"]);
    let recommended: Vec<_> = listed.iter().filter(|e| e["recommended"] == true).collect();
    assert_eq!(recommended.len(), 1);
    assert_eq!(recommended[0]["needs_antenna"], true);
}

#[test]
fn planners_have_a_source() {
    let (listed, _) = list("planners");
    for planner in &listed {
        has(planner, &["name", "about", "source"]);
    }
    assert!(listed.iter().any(|planner| planner["name"] == "bayesian-optimisation"));
}
