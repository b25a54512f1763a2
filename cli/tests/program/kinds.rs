//! Recordings of strangers, one of each kind that foxhunt once located wrongly and in silence, and
//! draws of these kinds.

use serde_json::Value;

use crate::support::{data, foxhunt};

/// Classes that draw the kinds (docs/judging.md). Of one place and of none nothing may be answered.
const KINDS: [&str; 17] = [
    "lanes-long",
    "home",
    "ceiling",
    "house",
    "jumps",
    "no-fix",
    "clock-back",
    "unsigned",
    "attenuator",
    "comma",
    "bearings-far",
    "bearings-diverge",
    "bearings-north",
    "bearings-array",
    "groups-back",
    "differences-two",
    "bearings-place",
];

#[test]
fn draws_of_each_kind_are_right_or_in_doubt() {
    let classes = KINDS.join(",");
    let args = ["soak", "--recordings", "--runs", "3", "--seed", "11", "--against", "strongest"];
    let more = ["--class", &classes, "--quiet", "--json"];
    let report = foxhunt(args.into_iter().chain(more)).json();
    let drawn = report["classes"].as_array().expect("classes");
    assert_eq!(drawn.len(), KINDS.len());
    for class in drawn {
        let name = &class["class"];
        let own = &class["default"];
        assert_eq!(own["silent_and_wrong"], 0, "{name}");
        let answered = own["scores"]["fixes"].as_u64().unwrap_or(0)
            - own["scores"]["failed"].as_u64().unwrap_or(0);
        assert_eq!(answered > 0, name != "bearings-place", "{name}: {answered} answers");
    }
}

fn located(file: &str, flags: &[&str]) -> Value {
    let file = data(&format!("doubts/{file}"));
    foxhunt(["locate", "--json", &file].iter().chain(flags)).json()
}

fn codes(answer: &Value) -> Vec<&str> {
    let remarks = answer["remarks"].as_array().expect("remarks");
    remarks.iter().filter_map(|remark| remark["code"].as_str()).collect()
}

#[test]
fn recordings_of_each_kind_are_right() {
    // Levels, and the most metres that the answer may be off.
    let right: [(&str, &[&str], f64); 4] = [
        ("ble_house.csv", &[], 1.0),
        ("fox_found.csv", &["--receiver-sigma-m", "4"], 5.0),
        ("saturated.csv", &["--beacon", "b0"], 25.0),
        ("saturated.csv", &["--beacon", "b1"], 25.0),
    ];
    for (file, flags, most_m) in right {
        let answer = located(file, flags);
        let error_m = answer["error_m"].as_f64().expect("the truth is known");
        let nees = answer["nees"].as_f64().expect("the truth is known");
        assert!(error_m < most_m && nees < 6.0, "{file}: {error_m} m off, NEES {nees}");
    }
    // The same levels, written in two ways.
    let signless = located("positive_rssi.csv", &[]);
    assert!(codes(&signless).contains(&"positive-levels"));
    let mended = located("positive_rssi.csv", &["--negate-levels"]);
    let commas = located("decimal_comma.csv", &[]);
    for (answer, name) in [(&mended, "levels"), (&commas, "commas")] {
        assert_eq!(codes(answer), [""; 0], "{name}");
        for (axis, place) in [("east_m", 90.0), ("north_m", 75.0)] {
            let apart = answer["estimate"][axis].as_f64().expect("a place") - place;
            assert!(apart.abs() < 2.0, "{name}: {apart} m");
        }
    }
}
