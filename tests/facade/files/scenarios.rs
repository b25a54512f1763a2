//! Scenarios as they are read, and those of the program.

use foxhunt::{
    registry::Registry,
    scenario::{Scenario, builtin_scenarios},
};

const TAG: &str = include_str!("../../../hunt/scenarios/vhf-tag.toml");

#[test]
fn a_clock_that_does_not_move_is_refused() {
    let text = TAG.to_owned() + "\n[simulation]\ntick_s = 1e-300\n";
    let error = Scenario::parse(&text, "slow.toml").expect_err("it would never end");
    let error = error.to_string();
    assert!(error.contains("slow.toml: simulation.tick_s is"), "{error}");
}

#[test]
fn turns_that_cannot_be_are_refused_by_name() {
    let parse = |turns: &str| Scenario::parse(&format!("{TAG}\n[turns]\n{turns}"), "goal.toml");
    for (turns, expected) in [
        ("bearing_sigma_deg = 0.0\nlongest_s = 60.0", "turns: bearing_sigma_deg is 0"),
        ("bearing_sigma_deg = 6.0\nlongest_s = 500.0", "turns: longest_s is 500"),
    ] {
        let error = parse(turns).expect_err(turns).to_string();
        assert!(error.contains(expected), "{error}");
    }
    let mut scenario = parse("bearing_sigma_deg = 6.0\nlongest_s = 80.0").expect("in order");
    // Planners reckon with the pulses that it takes.
    let with = scenario.field().turn_s.expect("it turns");
    scenario.turns.as_mut().expect("as parsed").bearing_sigma_deg = 0.7;
    assert!(scenario.field().turn_s.expect("it turns") > 1.5 * with);
    let stepper = TAG.find("[source]").expect("it has one")..TAG.find("[model]").expect("so");
    let text = TAG.replace(&TAG[stepper], "[source]\nkind = \"omnidirectional\"\n\n");
    let text = format!("{text}\n[turns]\nbearing_sigma_deg = 6.0\nlongest_s = 60.0");
    let error = Scenario::parse(&text, "goal.toml").expect_err("it does not turn").to_string();
    assert!(error.contains("neither steps nor turns"), "{error}");
}

#[test]
fn every_text_is_a_scenario_of_its_name() {
    let registry = Registry::builtin();
    for scenario in builtin_scenarios() {
        assert_eq!(Scenario::find(&scenario.name).expect("it is built in"), scenario);
        assert!(registry.estimator(&scenario.estimator).is_ok());
    }
}
