use std::{fs, path::Path};

use super::{
    Scenario, ScenarioError,
    builtin::{builtin_scenarios, builtin_text},
    random_fleet::{random_fleet, seed_in},
};

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
