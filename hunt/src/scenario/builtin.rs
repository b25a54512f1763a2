use super::Scenario;

/// The scenario that is flown when none is named.
pub const DEFAULT_SCENARIO: &str = "pritzl-6.1";

/// The built-in scenarios' texts, by name.
const TEXTS: [(&str, &str); 24] = [
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
    ("mixed-team", include_str!("../../scenarios/mixed-team.toml")),
    ("two-transmitters", include_str!("../../scenarios/two-transmitters.toml")),
    ("several-transmitters", include_str!("../../scenarios/several-transmitters.toml")),
    ("tdoa", include_str!("../../scenarios/tdoa.toml")),
];

/// Returns the file of a built-in scenario, as TOML.
#[must_use]
#[inline]
pub fn builtin_text(name: &str) -> Option<&'static str> {
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
