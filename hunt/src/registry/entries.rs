//! The entries of the registry, and the field that planners are made for.

use std::{borrow::Cow, fmt, sync::Arc};

use foxhunt_core::{BeaconId, BearingExtractor, EstimatorError, FormationPlanner, Quantity};
use foxhunt_sim::{SimError, World};
use nalgebra::Vector3;

use super::RegistryError;
use crate::{
    config::{EstimatorConfig, ExtractorConfig, PlannerConfig, PulseModel, ReceiverModel},
    hunt::{BoxedSource, Components, HuntConfig, Search, Track},
    locate::Locator,
};

/// Conditions of a hunt that planners need for their settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// The planner that the scenario or the flight brings.
    pub planner: PlannerConfig,
    /// The path-loss exponent that the estimators take.
    pub exponent: f64,
    /// Speed of the drones, in metres per second, if known.
    pub speed_mps: Option<f64>,
    /// Speed of their climb, in metres per second, if known.
    pub climb_mps: Option<f64>,
    /// Duration of the slowest turn, in seconds, if known.
    pub turn_s: Option<f64>,
    /// Prior, airspace and distances.
    pub hunt: HuntConfig,
    /// Places where the drones begin: East, North and Up in metres.
    pub drones_m: Vec<Vector3<f64>>,
}

/// Way to build something that has a name: by settings that may stand in files, or by code of its
/// own.
pub enum Recipe<S, F: ?Sized> {
    /// Settings.
    Settings(S),
    /// Code.
    Own(Arc<F>),
}

impl<S: Clone, F: ?Sized> Clone for Recipe<S, F> {
    fn clone(&self) -> Self {
        match self {
            Self::Settings(settings) => Self::Settings(settings.clone()),
            Self::Own(code) => Self::Own(Arc::clone(code)),
        }
    }
}

impl<S: fmt::Debug, F: ?Sized> fmt::Debug for Recipe<S, F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Settings(settings) => f.debug_tuple("Settings").field(settings).finish(),
            Self::Own(_) => f.write_str("Own"),
        }
    }
}

/// Parts that an estimator of a hunt is built from.
#[derive(Clone, Debug)]
pub struct TrackRequest<'a> {
    /// The beacon, and the belief of its place.
    pub search: Search<'a>,
    /// The law of propagation, the antenna's vertical pattern, and the terrain.
    pub model: &'a ReceiverModel,
    /// Place of the reference receiver of range and level differences: East, North and Up in
    /// metres, if there is one.
    pub reference: Option<Vector3<f64>>,
    /// The level of single pulses, where the antenna is known.
    pub pulses: Option<&'a PulseModel>,
    /// The seed for estimators that draw random numbers; it differs from beacon to beacon.
    pub seed: u64,
}

/// Code that builds the estimator of a beacon.
pub type MakeTrack = dyn Fn(&TrackRequest<'_>) -> Result<Track, EstimatorError> + Send + Sync;

/// Use that an estimator makes of a component of the receptions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// The estimator ignores receptions that lack this component.
    Required,
    /// It takes it where there is one.
    Used,
    /// It makes no difference.
    Unused,
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Required => "required",
            Self::Used => "used",
            Self::Unused => "unused",
        })
    }
}

/// Inputs that an estimator works on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Needs {
    /// Levels.
    pub level: Need,
    /// Bearings.
    pub bearing: Need,
    /// Quantities besides these, all of them required.
    pub others: Vec<Quantity>,
    /// True if it follows a beacon that moves.
    pub moving: bool,
    /// True if it takes all receptions at once and no stream of them.
    pub all_at_once: bool,
}

/// An estimator that has a name.
#[derive(Clone)]
pub struct EstimatorEntry {
    /// Name of the estimator, as `--estimator` takes it.
    pub name: Cow<'static, str>,
    /// Description in a line.
    pub about: Cow<'static, str>,
    /// Origin, such as a section of a publication.
    pub source: Cow<'static, str>,
    when: Option<Cow<'static, str>>,
    needs: Needs,
    leaves_out_outliers: bool,
    build: Build,
}

#[derive(Clone)]
#[expect(clippy::large_enum_variant, reason = "a registry has some thirty of them")]
enum Build {
    Stream(Recipe<EstimatorConfig, MakeTrack>),
    AtOnce(Arc<dyn Locator>),
}

impl fmt::Debug for EstimatorEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("EstimatorEntry")
            .field("name", &self.name)
            .field("needs", &self.needs)
            .field("settings", &self.settings())
            .finish_non_exhaustive()
    }
}

impl EstimatorEntry {
    /// An estimator of the library's parts.
    pub fn of_settings(
        name: impl Into<Cow<'static, str>>,
        about: impl Into<Cow<'static, str>>,
        source: impl Into<Cow<'static, str>>,
        settings: EstimatorConfig,
    ) -> Self {
        use crate::hunt::WithoutBearing::Discard;
        let needs = |settings: &EstimatorConfig| {
            let bearing =
                if settings.track.without_bearing == Discard { Need::Required } else { Need::Used };
            let (level, bearing) = match settings.track.components {
                Components::Both => (Need::Used, bearing),
                Components::RssOnly => (Need::Required, Need::Unused),
                Components::BearingOnly => (Need::Unused, Need::Required),
            };
            let moving = settings.moving.is_some();
            Needs { level, bearing, others: Vec::new(), moving, all_at_once: false }
        };
        Self {
            name: name.into(),
            about: about.into(),
            source: source.into(),
            needs: needs(&settings),
            when: None,
            leaves_out_outliers: false,
            build: Build::Stream(Recipe::Settings(settings)),
        }
    }

    /// A user's own estimator, which takes one reception after the other. It may be a filter of
    /// foxhunt over a user's own model; `request.model` is the model that the scenario states.
    ///
    /// ```
    /// use foxhunt_core::RandomWalk;
    /// use foxhunt_filters::Ckf;
    /// use foxhunt_hunt::{
    ///     hunt::{Track, TrackConfig},
    ///     registry::{EstimatorEntry, Need, Needs, Registry, TrackRequest},
    /// };
    ///
    /// let needs = Needs {
    ///     level: Need::Used,
    ///     bearing: Need::Used,
    ///     others: Vec::new(),
    ///     moving: false,
    ///     all_at_once: false,
    /// };
    /// let make = |request: &TrackRequest<'_>| {
    ///     let walk = RandomWalk::uniform(0.02);
    ///     let filter = Ckf::new(walk, request.model.clone(), request.search.prior)?;
    ///     Ok(Track::new::<2, 2>(filter, TrackConfig::default()))
    /// };
    /// let own = EstimatorEntry::own("mine", "a bare cubature filter", "here", needs, make);
    /// let registry = Registry::builtin().with_estimator(own);
    /// assert!(registry.estimator("mine").is_ok());
    /// ```
    pub fn own(
        name: impl Into<Cow<'static, str>>,
        about: impl Into<Cow<'static, str>>,
        source: impl Into<Cow<'static, str>>,
        needs: Needs,
        make: impl Fn(&TrackRequest<'_>) -> Result<Track, EstimatorError> + Send + Sync + 'static,
    ) -> Self {
        Self {
            name: name.into(),
            about: about.into(),
            source: source.into(),
            needs: Needs { all_at_once: false, ..needs },
            when: None,
            leaves_out_outliers: false,
            build: Build::Stream(Recipe::Own(Arc::new(make))),
        }
    }

    /// An estimator that takes all receptions at once.
    pub fn at_once(
        name: impl Into<Cow<'static, str>>,
        about: impl Into<Cow<'static, str>>,
        source: impl Into<Cow<'static, str>>,
        needs: Needs,
        locator: impl Locator + 'static,
    ) -> Self {
        Self {
            name: name.into(),
            about: about.into(),
            source: source.into(),
            needs: Needs { all_at_once: true, ..needs },
            when: None,
            leaves_out_outliers: false,
            build: Build::AtOnce(Arc::new(locator)),
        }
    }

    /// Locates without the bearings and other measurements that all others contradict, and says so
    /// in a remark; by default the remark alone is made.
    #[must_use]
    pub fn without_outliers(self) -> Self {
        Self { leaves_out_outliers: true, ..self }
    }

    /// Lists it among the estimators to choose from, with the cases to use it for.
    #[must_use]
    pub fn recommended_for(self, when: impl Into<Cow<'static, str>>) -> Self {
        Self { when: Some(when.into()), ..self }
    }

    /// Returns the cases to use it for; `None` if it is not among the estimators to choose from.
    #[must_use]
    pub fn when(&self) -> Option<&str> {
        self.when.as_deref()
    }

    /// Returns true if measurements that all others contradict are left out.
    #[must_use]
    pub fn leaves_out_outliers(&self) -> bool {
        self.leaves_out_outliers
    }

    /// Returns the inputs that it works on.
    #[must_use]
    pub fn needs(&self) -> &Needs {
        &self.needs
    }

    /// Returns the settings of the estimator, where it is made of the library's parts.
    #[must_use]
    pub fn settings(&self) -> Option<&EstimatorConfig> {
        match &self.build {
            Build::Stream(Recipe::Settings(settings)) => Some(settings),
            _ => None,
        }
    }

    /// Returns true if it takes the samples of a turn one by one, each with the antenna's
    /// boresight.
    #[must_use]
    pub fn takes_samples(&self) -> bool {
        self.needs.others.contains(&Quantity::BORESIGHT)
    }

    /// The estimator with other settings.
    ///
    /// # Errors
    ///
    /// [`RegistryError::NoSetting`], with the name of the `setting`, if it has no settings.
    pub fn with_settings(
        &self,
        setting: &'static str,
        change: impl FnOnce(&mut EstimatorConfig),
    ) -> Result<Self, RegistryError> {
        let Some(mut settings) = self.settings().copied() else {
            let estimator = self.name.clone().into_owned();
            return Err(RegistryError::NoSetting { estimator, setting });
        };
        change(&mut settings);
        let name = self.name.clone();
        let about = self.about.clone();
        let changed = Self::of_settings(name, about, self.source.clone(), settings);
        let leaves_out_outliers = self.leaves_out_outliers;
        Ok(Self { when: self.when.clone(), leaves_out_outliers, ..changed })
    }

    /// Returns its locator, if it takes all receptions at once.
    #[must_use]
    pub fn locator(&self) -> Option<&dyn Locator> {
        match &self.build {
            Build::AtOnce(locator) => Some(locator.as_ref()),
            Build::Stream(_) => None,
        }
    }

    /// Refuses an estimator that takes all receptions at once.
    ///
    /// # Errors
    ///
    /// [`RegistryError::NeedsAllAtOnce`].
    pub fn require_stream(&self) -> Result<(), RegistryError> {
        if self.needs.all_at_once {
            let estimator = self.name.clone().into_owned();
            return Err(RegistryError::NeedsAllAtOnce { estimator });
        }
        Ok(())
    }

    /// Builds the track of a beacon, one that [`Track::smoothed`] goes back over. A user's own
    /// estimator is so if its code makes it so, with [`Track::smoothable`].
    ///
    /// # Errors
    ///
    /// The errors of [`track`](Self::track).
    pub fn smoothable_track(&self, request: &TrackRequest<'_>) -> Result<Track, EstimatorError> {
        match &self.build {
            Build::Stream(Recipe::Settings(settings)) => {
                let TrackRequest { search, model, seed, .. } = request;
                settings.smoothable_track((*model).clone(), &search.prior, *seed)
            }
            _ => self.track(request, true),
        }
    }

    /// Builds the track of a beacon. With `monitored` it keeps its innovations, if it is made of
    /// the library's parts.
    ///
    /// # Errors
    ///
    /// [`EstimatorError`] when the prior or a parameter does not make one, or it takes all
    /// receptions at once.
    pub fn track(
        &self,
        request: &TrackRequest<'_>,
        monitored: bool,
    ) -> Result<Track, EstimatorError> {
        match &self.build {
            Build::Stream(Recipe::Settings(settings)) => {
                let TrackRequest { search, model, seed, .. } = request;
                settings.track((*model).clone(), &search.prior, *seed, monitored)
            }
            Build::Stream(Recipe::Own(make)) => make(request),
            Build::AtOnce(_) => Err(EstimatorError::Unsupported {
                what: "a stream of receptions by an estimator that takes all of them at once",
            }),
        }
    }
}

/// Code that builds an extractor.
pub type MakeExtractor = dyn Fn() -> Box<dyn BearingExtractor + Send + Sync> + Send + Sync;

/// An extractor that has a name.
#[derive(Clone, Debug)]
pub struct ExtractorEntry {
    /// Name of the extractor, as `--extractor` takes it.
    pub name: Cow<'static, str>,
    /// Description in a line.
    pub about: Cow<'static, str>,
    /// Origin, such as a section of a publication.
    pub source: Cow<'static, str>,
    /// Recipe by which it is built.
    pub recipe: Recipe<ExtractorConfig, MakeExtractor>,
}

impl ExtractorEntry {
    /// A user's own extractor.
    pub fn own(
        name: impl Into<Cow<'static, str>>,
        about: impl Into<Cow<'static, str>>,
        source: impl Into<Cow<'static, str>>,
        make: impl Fn() -> Box<dyn BearingExtractor + Send + Sync> + Send + Sync + 'static,
    ) -> Self {
        let recipe = Recipe::Own(Arc::new(make) as Arc<MakeExtractor>);
        Self { name: name.into(), about: about.into(), source: source.into(), recipe }
    }

    /// Returns its configuration, as it stands in a file.
    #[must_use]
    pub fn config(&self) -> ExtractorConfig {
        match &self.recipe {
            Recipe::Settings(settings) => settings.clone(),
            Recipe::Own(_) => ExtractorConfig::Registered { name: self.name.clone().into_owned() },
        }
    }
}

/// Code that builds a planner for a field.
pub type MakePlanner = dyn Fn(&Field) -> Box<dyn FormationPlanner> + Send + Sync;

/// A planner that has a name.
#[derive(Clone, Debug)]
pub struct PlannerEntry {
    /// Name of the planner, as `--planner` takes it.
    pub name: Cow<'static, str>,
    /// Description in a line.
    pub about: Cow<'static, str>,
    /// Origin, such as a section of a publication.
    pub source: Cow<'static, str>,
    /// Recipe by which it is built: settings that follow from the field, or code.
    pub recipe: Recipe<fn(&Field) -> PlannerConfig, MakePlanner>,
}

impl PlannerEntry {
    /// A user's own planner.
    pub fn own(
        name: impl Into<Cow<'static, str>>,
        about: impl Into<Cow<'static, str>>,
        source: impl Into<Cow<'static, str>>,
        make: impl Fn(&Field) -> Box<dyn FormationPlanner> + Send + Sync + 'static,
    ) -> Self {
        let recipe = Recipe::Own(Arc::new(make) as Arc<MakePlanner>);
        Self { name: name.into(), about: about.into(), source: source.into(), recipe }
    }
}

/// Code that builds the source of a drone of a simulated world.
pub type MakeSource = dyn Fn(&World, usize) -> Result<BoxedSource, SimError> + Send + Sync;

/// A source of sweeps for simulated worlds that has a name.
#[derive(Clone)]
pub struct SourceEntry {
    /// Name of the source.
    pub name: Cow<'static, str>,
    /// Description in a line.
    pub about: Cow<'static, str>,
    /// Quantities that it measures besides level and bearing.
    pub quantities: Vec<Quantity>,
    make: Arc<MakeSource>,
}

impl fmt::Debug for SourceEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SourceEntry")
            .field("name", &self.name)
            .field("quantities", &self.quantities)
            .finish_non_exhaustive()
    }
}

impl SourceEntry {
    /// A user's own source.
    pub fn own(
        name: impl Into<Cow<'static, str>>,
        about: impl Into<Cow<'static, str>>,
        quantities: &[Quantity],
        make: impl Fn(&World, usize) -> Result<BoxedSource, SimError> + Send + Sync + 'static,
    ) -> Self {
        let make = Arc::new(make);
        Self { name: name.into(), about: about.into(), quantities: quantities.to_vec(), make }
    }

    /// Builds the source of a drone.
    ///
    /// # Errors
    ///
    /// [`SimError`] when there is no such drone, or a number is out of its range.
    pub fn build(&self, world: &World, drone: usize) -> Result<BoxedSource, SimError> {
        (self.make)(world, drone)
    }
}

/// One seed for each beacon of a run, so that their filters do not draw the same numbers.
#[must_use]
pub fn beacon_seed(run: u64, beacon: BeaconId) -> u64 {
    // The odd constant is 2⁶⁴ over the golden ratio (Steele et al. 2014, SplitMix).
    run ^ 0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(u64::from(beacon.0) + 1)
}
