//! The built-in scenarios, and how a scenario is found by its name or file.

use std::{fs, path::Path};

use super::{
    Scenario, ScenarioError,
    random_fleet::{random_fleet, seed_in},
};

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

impl Scenario {
    /// The scenario of a built-in name or of a [`random_fleet`], or else of a TOML file.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] names the file, the line and the field.
    #[inline]
    pub fn find(name_or_path: &str) -> Result<Self, ScenarioError> {
        if let Some(text) = builtin_text(name_or_path) {
            return Self::parse(text, name_or_path);
        }
        if let Some(seed) = seed_in(name_or_path) {
            return Ok(random_fleet(seed));
        }
        let path = Path::new(name_or_path);
        if !path.exists() {
            let known = builtin_scenarios().into_iter().map(|s| s.name).collect();
            return Err(ScenarioError::Unknown { name: name_or_path.to_owned(), known });
        }
        let text = fs::read_to_string(path)
            .map_err(|source| ScenarioError::Read { file: name_or_path.to_owned(), source })?;
        let mut scenario = Self::parse(&text, name_or_path)?;
        if let Some(folder) = path.parent() {
            let terrain = scenario.world.terrain.take();
            scenario.world.terrain = terrain.map(|terrain| terrain.in_folder(folder));
            scenario.model = scenario.model.in_folder(folder);
        }
        Ok(scenario)
    }
}

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
