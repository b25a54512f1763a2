//! The registry: everything that has a name, open to a user's own entries.
//!
//! A name means one thing wherever it is used: hunts, replays, `locate`, trials, campaigns and
//! lists read the same entry. A setting that a caller cannot honour is an error, never dropped.

mod combined;
mod entries;
mod estimators;
mod extractors;
mod locators;
mod parts;
mod planners;
mod stream;

pub use crate::config::RegistryError;
pub use entries::{
    EstimatorEntry, ExtractorEntry, Field, MakeExtractor, MakePlanner, MakeSource, MakeTrack, Need,
    Needs, PlannerEntry, Recipe, SourceEntry, TrackRequest, beacon_seed,
};
pub use estimators::DEFAULT_ESTIMATOR;
pub use extractors::{RECOMMENDED_EXTRACTOR, antenna_named};
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
            estimators: estimators::builtin(),
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
        menu.sort_by_key(|entry| estimators::menu_place(&entry.name));
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
