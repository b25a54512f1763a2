//! The registry: everything that has a name, open to a user's own entries.
//!
//! A name means one thing wherever it is used: hunts, replays, `locate`, trials, campaigns and
//! lists read the same entry. A setting that a caller cannot honour is an error, never dropped.

mod combined;
mod entries;
mod estimators;
mod extractors;
mod field;
mod locators;
mod menu;
mod parts;
mod planners;
mod recalled_grid;
mod stream;

pub use crate::config::RegistryError;
pub use entries::{
    EstimatorEntry, ExtractorEntry, MakeExtractor, MakePlanner, MakeSource, MakeTrack, Need, Needs,
    PlannerEntry, Recipe, SourceEntry, TrackRequest, beacon_seed,
};
pub use estimators::DEFAULT_ESTIMATOR;
pub use extractors::{RECOMMENDED_EXTRACTOR, antenna_named};
pub use field::Field;
pub use parts::{HuntExtractor, HuntParts, PartsError};

use foxhunt_core::{BearingExtractor, FormationPlanner};

use crate::config::{
    ExtractorConfig, ExtractorConfigError, ModelConfig, PlannerConfig, PlannerConfigError,
    SourceConfig,
};

/// The names of estimators, extractors, planners and sources, and what each stands for.
#[derive(Clone, Debug)]
pub struct Registry {
    estimators: Vec<EstimatorEntry>,
    extractors: Vec<ExtractorEntry>,
    planners: Vec<PlannerEntry>,
    sources: Vec<SourceEntry>,
}

impl Registry {
    /// Returns a registry of the library's own entries.
    #[must_use]
    pub fn builtin() -> Self {
        Self {
            estimators: menu::with_menu(estimators::builtin()),
            extractors: extractors::builtin(),
            planners: planners::builtin(),
            sources: Vec::new(),
        }
    }

    /// Adds an estimator, or replaces the one of its name. It is in the menu; if it does not say
    /// when to use it, its description stands there.
    #[must_use]
    pub fn with_estimator(mut self, entry: EstimatorEntry) -> Self {
        let entry = match entry.when() {
            Some(_) => entry,
            None => {
                let about = entry.about.clone();
                entry.recommended_for(about)
            }
        };
        put(&mut self.estimators, entry, |entry| &entry.name);
        self
    }

    /// Adds an extractor, or replaces the one of its name.
    #[must_use]
    pub fn with_extractor(mut self, entry: ExtractorEntry) -> Self {
        put(&mut self.extractors, entry, |entry| &entry.name);
        self
    }

    /// Adds a planner, or replaces the one of its name.
    #[must_use]
    pub fn with_planner(mut self, entry: PlannerEntry) -> Self {
        put(&mut self.planners, entry, |entry| &entry.name);
        self
    }

    /// Adds a source of sweeps for simulated worlds, or replaces the one of its name.
    #[must_use]
    pub fn with_source(mut self, entry: SourceEntry) -> Self {
        put(&mut self.sources, entry, |entry| &entry.name);
        self
    }

    /// Every estimator, in the order of the list.
    #[must_use]
    pub fn estimators(&self) -> &[EstimatorEntry] {
        &self.estimators
    }

    /// Estimators to choose from, in the order of the menu: some of the library's, and all of the
    /// user's own. Each says when to use it ([`EstimatorEntry::when`]).
    #[must_use]
    pub fn menu(&self) -> Vec<&EstimatorEntry> {
        let mut menu: Vec<_> = self.estimators.iter().filter(|e| e.when().is_some()).collect();
        menu.sort_by_key(|entry| menu::place(&entry.name));
        menu
    }

    /// Every extractor.
    #[must_use]
    pub fn extractors(&self) -> &[ExtractorEntry] {
        &self.extractors
    }

    /// Every planner.
    #[must_use]
    pub fn planners(&self) -> &[PlannerEntry] {
        &self.planners
    }

    /// Returns every registered source; [`SourceConfig`]'s own kinds are not among them.
    #[must_use]
    pub fn sources(&self) -> &[SourceEntry] {
        &self.sources
    }

    /// The estimator of a name.
    ///
    /// # Errors
    ///
    /// [`RegistryError::Unknown`] lists the names that there are.
    pub fn estimator(&self, name: &str) -> Result<&EstimatorEntry, RegistryError> {
        find("estimator", &self.estimators, name, |entry| &entry.name)
    }

    /// The extractor of a name.
    ///
    /// # Errors
    ///
    /// [`RegistryError::Unknown`] lists the names that there are.
    pub fn extractor(&self, name: &str) -> Result<&ExtractorEntry, RegistryError> {
        find("extractor", &self.extractors, name, |entry| &entry.name)
    }

    /// The planner of a name.
    ///
    /// # Errors
    ///
    /// [`RegistryError::Unknown`] lists the names that there are.
    pub fn planner(&self, name: &str) -> Result<&PlannerEntry, RegistryError> {
        find("planner", &self.planners, name, |entry| &entry.name)
    }

    /// The source of a name.
    ///
    /// # Errors
    ///
    /// [`RegistryError::Unknown`] lists the names that there are.
    pub fn source(&self, name: &str) -> Result<&SourceEntry, RegistryError> {
        find("source", &self.sources, name, |entry| &entry.name)
    }

    /// The source of a kind or of an entry's name, by its defaults, for a hunt with this model; of
    /// the kind of `own` that one.
    ///
    /// # Errors
    ///
    /// [`RegistryError::Unknown`] lists the names that there are; [`RegistryError::NoReference`]
    /// for range differences where the model has no place of a reference receiver.
    pub fn source_config(
        &self,
        name: &str,
        own: &SourceConfig,
        model: &ModelConfig,
    ) -> Result<SourceConfig, RegistryError> {
        if self.sources.iter().any(|entry| entry.name == name) {
            return Ok(SourceConfig::Registered { name: name.to_owned() });
        }
        let kinds = SourceConfig::KINDS.map(|(kind, _)| kind);
        if !kinds.contains(&name) {
            let registered = self.sources.iter().map(|entry| entry.name.to_string());
            return Err(RegistryError::Unknown {
                what: "source",
                name: name.to_owned(),
                known: kinds.map(str::to_owned).into_iter().chain(registered).collect(),
            });
        }
        if own.kind() == name {
            return Ok(own.clone());
        }
        SourceConfig::of_kind(name, model.reference_m).ok_or(RegistryError::NoReference)
    }

    /// Builds an extractor; one that is registered under a name by its entry.
    ///
    /// # Errors
    ///
    /// [`ExtractorConfigError`] names what is out of its range or not known.
    pub fn build_extractor(
        &self,
        config: &ExtractorConfig,
    ) -> Result<Box<dyn BearingExtractor + Send + Sync>, ExtractorConfigError> {
        match config {
            ExtractorConfig::Registered { name } => match &self.extractor(name)?.recipe {
                Recipe::Settings(ExtractorConfig::Registered { .. }) => {
                    Err(ExtractorConfigError::Circle { name: name.clone() })
                }
                Recipe::Settings(settings) => settings.build(),
                Recipe::Own(build) => Ok(build()),
            },
            config => config.build(),
        }
    }

    /// Builds a planner; one that is registered under a name by its entry, in a field.
    ///
    /// # Errors
    ///
    /// [`PlannerConfigError`] names what is out of its range or not known.
    pub fn build_planner(
        &self,
        config: &PlannerConfig,
        field: &Field,
    ) -> Result<Box<dyn FormationPlanner>, PlannerConfigError> {
        match config {
            PlannerConfig::Registered { name } => match &self.planner(name)?.recipe {
                Recipe::Settings(settings) => settings(field).build(),
                Recipe::Own(build) => Ok(build(field)),
            },
            config => config.build(),
        }
    }
}

impl Default for Registry {
    /// [`Registry::builtin`].
    fn default() -> Self {
        Self::builtin()
    }
}

fn put<E>(entries: &mut Vec<E>, entry: E, name: impl Fn(&E) -> &str) {
    match entries.iter().position(|known| name(known) == name(&entry)) {
        Some(index) => entries[index] = entry,
        None => entries.push(entry),
    }
}

fn find<'a, E>(
    what: &'static str,
    entries: &'a [E],
    name: &str,
    name_of: impl Fn(&E) -> &str,
) -> Result<&'a E, RegistryError> {
    entries.iter().find(|entry| name_of(entry) == name).ok_or_else(|| RegistryError::Unknown {
        what,
        name: name.to_owned(),
        known: entries.iter().map(|entry| name_of(entry).to_owned()).collect(),
    })
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{
        BeaconId, Bearing, BearingModes, Estimate, EstimatorError, Level, MeasuredList, Pose,
        Reception,
    };
    use foxhunt_sensors::{LogDistance, RssBearing};
    use nalgebra::Vector2;

    use super::*;
    use crate::config::{EstimatorConfig, FilterConfig};

    #[test]
    fn names_are_found_and_differ() {
        let registry = Registry::builtin();
        for (index, entry) in registry.estimators().iter().enumerate() {
            let found = registry.estimator(&entry.name).expect("it is listed");
            assert!(std::ptr::eq(found, &registry.estimators()[index]), "{} twice", entry.name);
        }
        for entry in registry.extractors() {
            assert!(registry.extractor(&entry.name).is_ok());
        }
        let error = registry.estimator("kalman").expect_err("no such name").to_string();
        assert!(error.contains("\"kalman\"") && error.contains("ukf-pritzl2018"), "{error}");
    }

    #[test]
    fn an_entry_of_ones_own_is_added_or_replaces() {
        let count = Registry::builtin().estimators().len();
        let settings = |registry: &Registry, name: &str| {
            *registry.estimator(name).expect("known").settings().expect("settings")
        };
        let mut small = settings(&Registry::builtin(), "particle");
        small.filter = FilterConfig::Particle { count: 100, adaptive_bin: None, every_step: false };
        let own = |name: &str| {
            EstimatorEntry::of_settings(name.to_owned(), "a small cloud", "none", small)
        };
        let registry = Registry::builtin().with_estimator(own("tiny")).with_estimator(own("ukf"));
        assert_eq!(registry.estimators().len(), count + 1);
        assert_eq!(settings(&registry, "tiny"), small);
        assert_eq!(settings(&registry, "ukf"), small);
    }

    #[test]
    fn the_menu_has_what_is_taken_by_itself_and_what_is_ones_own() {
        let registry = Registry::builtin();
        let menu: Vec<&str> = registry.menu().iter().map(|entry| &*entry.name).collect();
        assert_eq!(menu.len(), menu::MENU.len(), "each name of the menu is an estimator: {menu:?}");
        assert_eq!(menu[0], DEFAULT_ESTIMATOR);
        for scenario in crate::scenario::builtin_scenarios() {
            assert!(menu.contains(&&*scenario.estimator), "{}", scenario.name);
        }
        let suited = |receptions: &[Reception]| {
            registry.suited_to(&receptions.into()).expect("an estimator").name.clone()
        };
        let bearing = Bearing { angle: 0.5, sigma: 0.1, confidence: 0.9 };
        let level = Level { rss_dbm: -60.0, sigma_db: 4.0 };
        let taken = |level, bearing| {
            let at = |east| Reception {
                beacon: BeaconId(1),
                time: 0.0,
                receiver: Pose::at(east, 0.0, 4.0),
                level,
                silence: None,
                saturation: None,
                bearing,
                covariance: 0.0,
                modes: BearingModes::default(),
                receiver_sigma_m: None,
                measured: MeasuredList::default(),
            };
            [suited(&[at(0.0)]), suited(&[at(0.0), at(100.0), at(200.0), at(300.0)])]
        };
        for (level, bearing) in
            [(Some(level), None), (None, Some(bearing)), (Some(level), Some(bearing))]
        {
            for name in taken(level, bearing) {
                assert!(menu.contains(&&*name), "`locate` takes {name} by itself");
            }
        }

        let mut own = registry.estimator("ekf-iterated").expect("it is listed").clone();
        own.name = "mine".into();
        let about = own.about.clone();
        let registry = registry.clone().with_estimator(own);
        let last = registry.menu().pop().expect("an entry").clone();
        assert_eq!((&*last.name, last.when()), ("mine", Some(&*about)));
        let with_case = last.recommended_for("Sundays");
        let registry = registry.with_estimator(with_case);
        assert_eq!(registry.estimator("mine").expect("it").when(), Some("Sundays"));
    }

    #[test]
    fn settings_that_would_not_be_used_are_refused() {
        let model = RssBearing::new(LogDistance::new(-29.06, 2.765).expect("in range"));
        let prior = Estimate::isotropic(Vector2::zeros(), 10.0);
        let registry = Registry::builtin();
        let config = |name| {
            let entry = registry.estimator(name).expect("it has a name");
            *entry.settings().expect("a stream estimator of the program")
        };
        let refused = |config: EstimatorConfig| match config.build(model, &prior, 1).err() {
            Some(EstimatorError::Unsupported { what }) => what,
            other => panic!("{other:?}"),
        };
        let late = EstimatorConfig { lag_s: Some(5.0), ..config("ukf-pritzl2018") };
        assert!(refused(late).contains("lag_s"));
        let moving = EstimatorConfig { power_sigma_db: Some(5.0), ..config("imm") };
        assert!(refused(moving).contains("power_sigma_db"));
        let cloud =
            EstimatorConfig { power_sigma_db: None, ..config("particle-rao-blackwellised") };
        assert!(refused(cloud).contains("reference power"));
        let seconds = EstimatorConfig { lag_s: Some(5.0), ..config("ukf") };
        assert!(seconds.build(model, &prior, 1).is_ok());
    }
}
