use super::Scenario;

/// The scenario that is flown when none is named.
pub const DEFAULT_SCENARIO: &str = "pritzl-6.1";

/// The built-in scenarios' texts, by name.
const TEXTS: [(&str, &str); 21] = [
    ("pritzl-6.1", include_str!("../../scenarios/pritzl-6.1.toml")),
    ("pritzl-6.1-scattered", include_str!("../../scenarios/pritzl-6.1-scattered.toml")),
    ("pritzl-7.1", include_str!("../../scenarios/pritzl-7.1.toml")),
    ("pritzl-7.2", include_str!("../../scenarios/pritzl-7.2.toml")),
    ("pritzl-7.2-body", include_str!("../../scenarios/pritzl-7.2-body.toml")),
    ("pritzl-7.2-flown", include_str!("../../scenarios/pritzl-7.2-flown.toml")),
    ("pritzl-7.3", include_str!("../../scenarios/pritzl-7.3.toml")),
    ("pritzl-7.4", include_str!("../../scenarios/pritzl-7.4.toml")),
    ("pritzl-7.4.1", include_str!("../../scenarios/pritzl-7.4.1.toml")),
    ("pritzl-7.5", include_str!("../../scenarios/pritzl-7.5.toml")),
    ("pritzl-7.5-broken-off", include_str!("../../scenarios/pritzl-7.5-broken-off.toml")),
    ("isaacs-static", include_str!("../../scenarios/isaacs-static-flown.toml")),
    ("isaacs-line", include_str!("../../scenarios/isaacs-line-flown.toml")),
    ("isaacs-circle", include_str!("../../scenarios/isaacs-circle-flown.toml")),
    ("far-start", include_str!("../../scenarios/far-start.toml")),
    ("three-beacons", include_str!("../../scenarios/three-beacons.toml")),
    ("one-drone", include_str!("../../scenarios/one-drone.toml")),
    ("rough-field", include_str!("../../scenarios/rough-field.toml")),
    ("vhf-tag", include_str!("../../scenarios/vhf-tag.toml")),
    ("avalanche", include_str!("../../scenarios/avalanche.toml")),
    ("tdoa", include_str!("../../scenarios/tdoa.toml")),
];

pub(super) fn text_of(name: &str) -> Option<&'static str> {
    TEXTS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// The scenarios that need no file.
#[must_use]
#[inline]
pub fn builtin_scenarios() -> Vec<Scenario> {
    TEXTS
        .iter()
        .map(|(name, text)| Scenario::parse(text, name).expect("a test parses each of them"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_does_not_move_is_refused() {
        let text = TEXTS[0].1.to_owned() + "\n[simulation]\ntick_s = 1e-300\n";
        let error = Scenario::parse(&text, "slow.toml").expect_err("it would never end");
        let error = error.to_string();
        assert!(error.contains("slow.toml: simulation.tick_s is"), "{error}");
    }

    #[test]
    fn turns_that_cannot_be_are_refused_by_name() {
        let text = TEXTS.iter().find(|(name, _)| *name == "vhf-tag").expect("built in").1;
        let parse =
            |turns: &str| Scenario::parse(&format!("{text}\n[turns]\n{turns}"), "goal.toml");
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
        let stepper = text.find("[source]").expect("it has one")..text.find("[model]").expect("so");
        let text = text.replace(&text[stepper], "[source]\nkind = \"omnidirectional\"\n\n");
        let text = format!("{text}\n[turns]\nbearing_sigma_deg = 6.0\nlongest_s = 60.0");
        let error = Scenario::parse(&text, "goal.toml").expect_err("it does not turn").to_string();
        assert!(error.contains("neither steps nor turns"), "{error}");
    }

    #[test]
    fn every_text_is_a_scenario_of_its_name() {
        let registry = crate::registry::Registry::builtin();
        for (name, text) in TEXTS {
            let scenario = Scenario::parse(text, name).expect("a built-in scenario is in order");
            assert_eq!(scenario.name, name);
            assert!(registry.estimator(&scenario.estimator).is_ok());
        }
    }
}
