use std::mem;

use foxhunt_core::{
    BearingModes, Belief, ByQuantity, Correction, Estimate, Estimator, EstimatorError, Intake,
    MeasurementModel, ObservationError, Quantity, Reading, Reception, Smooth,
    parameter::ParameterError,
};
use foxhunt_filters::{
    Remembering,
    consistency::{Monitored, NisHealth, NisWatchdog, Whiteness},
};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::team::{LearnedReceiver, Team};

/// Way in which receptions are put to an estimator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrackConfig {
    /// Quantity that a prediction's Δt counts; by default seconds.
    pub time_step: TimeStep,
    /// σ of the level in dB while the first formation position of a beacon is measured; the
    /// reading's own where absent, as by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_position_rss_sigma_db: Option<f64>,
    /// σ of the level in dB after that; the reading's own where absent, as by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rss_sigma_db: Option<f64>,
    /// Use of a reception without a bearing; by default its level is used.
    pub without_bearing: WithoutBearing,
    /// Components that are used: level, bearing or both; by default both.
    pub components: Components,
}

impl TrackConfig {
    /// The reference's (Pritzl 2018, §4.4 and §5.1): a step for every pattern used, σ of the
    /// level 1000 dB at the first formation position and 7.9 dB after it, no pattern without a
    /// bearing.
    #[must_use]
    pub const fn pritzl2018() -> Self {
        Self {
            time_step: TimeStep::PerReception,
            first_position_rss_sigma_db: Some(1000.0),
            rss_sigma_db: Some(Reading::RSS_SIGMA_DB),
            without_bearing: WithoutBearing::Discard,
            components: Components::Both,
        }
    }

    /// Refuses what is out of its range.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the field.
    pub fn check(&self) -> Result<(), ParameterError> {
        use foxhunt_core::parameter::{positive, require};
        let levels = self.components != Components::BearingOnly;
        for (name, sigma) in [
            ("first_position_rss_sigma_db", self.first_position_rss_sigma_db),
            ("rss_sigma_db", self.rss_sigma_db),
        ] {
            if let Some(sigma) = sigma {
                require(levels, name, sigma, "left out: no level is used")?;
                positive(name, sigma)?;
            }
        }
        Ok(())
    }

    /// The reception with the σ and the components of this configuration.
    fn apply_to(&self, reception: &Reception, first_position: bool) -> Reception {
        let mut used = *reception;
        let first = self.first_position_rss_sigma_db.filter(|_| first_position);
        if let (Some(sigma), Some(level)) = (first.or(self.rss_sigma_db), &mut used.level) {
            // The correlation with the bearing stays as it was read.
            used.covariance *= sigma / level.sigma_db;
            level.sigma_db = sigma;
        }
        match self.components {
            Components::Both => {}
            Components::RssOnly => {
                used.bearing = None;
                used.modes = BearingModes::default();
            }
            Components::BearingOnly => {
                used.level = None;
                used.covariance = 0.0;
            }
        }
        used
    }
}

/// Quantity that a prediction's Δt counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TimeStep {
    /// Seconds between the receptions.
    #[default]
    Elapsed,
    /// One for every reception, the first included.
    PerReception,
}

/// Use of a reception without a bearing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WithoutBearing {
    /// The level is used.
    #[default]
    UseLevel,
    /// It is not used, and makes no step at all.
    Discard,
}

/// Components that an estimator is given: level, bearing or both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Components {
    /// Both.
    #[default]
    Both,
    /// Signal strength alone.
    RssOnly,
    /// Bearings alone (Pritzl 2018, §7, by a σ of the level of 1000 dB).
    BearingOnly,
}

/// From this σ in dB on a level counts as no degree of freedom (Pritzl 2018, §4.4).
const NO_LEVEL_SIGMA_DB: f64 = 1000.0;

/// One beacon's estimator, whatever its state and its measurement, and how receptions are put to
/// it. The only way of a reception into an estimator: live, simulated, replayed and from a file.
pub struct Track {
    estimator: Box<dyn Fed>,
    config: TrackConfig,
    prior: Estimate<2>,
    time: Option<f64>,
    steps: u32,
    watchdog: NisWatchdog,
    health: NisHealth,
    /// Times of the receptions whose beliefs are remembered, each with its number among these.
    remembered: Vec<(f64, usize)>,
    /// True if the filter began to count as diverged at the last reception.
    alarm: bool,
}

impl Track {
    /// A track that is fed by the names of its model's quantities ([`ByQuantity`]).
    pub fn new<const N: usize, const M: usize>(
        estimator: impl Estimator<N, M> + 'static,
        config: TrackConfig,
    ) -> Self {
        let intake = ByQuantity(estimator.quantities());
        Self::of(Joined::alike(estimator, intake), config)
    }

    /// A track that is fed by an intake of its own.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Quantity`] when the intake's components are not those of the estimator's
    /// model.
    pub fn with_intake<const N: usize, const M: usize>(
        estimator: impl Estimator<N, M> + 'static,
        intake: impl Intake<M> + 'static,
        config: TrackConfig,
    ) -> Result<Self, EstimatorError> {
        let pairs = intake.quantities().into_iter().zip(estimator.quantities());
        for (component, (fed, expected)) in pairs.enumerate() {
            if fed != expected {
                return Err(EstimatorError::Quantity { component, fed, expected });
            }
        }
        Ok(Self::of(Joined::alike(estimator, intake), config))
    }

    /// A track that keeps the normalised innovations over `model`, for
    /// [whiteness](Self::add_innovations_to).
    pub fn monitored<const N: usize, const M: usize>(
        estimator: impl Estimator<N, M> + 'static,
        model: impl MeasurementModel<N, M> + 'static,
        config: TrackConfig,
    ) -> Self {
        let intake = ByQuantity(estimator.quantities());
        let estimator = Monitored::new(estimator, model);
        Self::of(Watched(Joined::alike(estimator, intake)), config)
    }

    /// A track that keeps its innovations, as a [monitored](Self::monitored) one does, and the
    /// beliefs that [`smoothed`](Self::smoothed) goes back over: a copy of the estimator for each
    /// time of a reception.
    pub fn smoothable<const N: usize, const M: usize>(
        estimator: impl Smooth<N, M> + Clone + 'static,
        model: impl MeasurementModel<N, M> + 'static,
        config: TrackConfig,
    ) -> Self {
        let intake = ByQuantity(estimator.quantities());
        let estimator = Monitored::new(Remembering::new(estimator), model);
        Self::of(Remembered(Watched(Joined::alike(estimator, intake))), config)
    }

    /// A track whose receivers have offsets of their own.
    pub(crate) fn of_team(team: Team, config: TrackConfig) -> Self {
        let intake = ByQuantity(team.quantities());
        let joined =
            Joined { hear: Team::heard_by, learned: Team::learned, ..Joined::alike(team, intake) };
        Self::of(joined, config)
    }

    /// A track of any estimator that takes receptions.
    pub(crate) fn of(estimator: impl Fed + 'static, config: TrackConfig) -> Self {
        let watchdog = NisWatchdog::default();
        Self {
            prior: estimator.position(),
            estimator: Box::new(estimator),
            config,
            time: None,
            steps: 0,
            health: watchdog.health(),
            watchdog,
            remembered: Vec::new(),
            alarm: false,
        }
    }

    /// Sets the prior of the log, where the first two moments of the estimator are not exactly the
    /// moments of the belief that it was made of.
    #[must_use]
    pub fn with_prior(self, prior: Estimate<2>) -> Self {
        Self { prior, ..self }
    }

    /// Sets when the prior is of, in seconds; that of the first reception unless given.
    #[must_use]
    pub fn starting_at(self, time: f64) -> Self {
        Self { time: Some(time), ..self }
    }

    /// Sets the receiver of the next receptions, counted from 0; the first one unless set. It
    /// counts for estimators that learn what each receiver gets wrong.
    pub fn heard_by(&mut self, receiver: usize) -> &mut Self {
        self.estimator.heard_by(receiver);
        self
    }

    /// Errors that were learned of each receiver that has received, with its number; empty for one
    /// that takes all receivers for alike.
    #[must_use]
    pub fn learned_receivers(&self) -> Vec<(usize, LearnedReceiver)> {
        self.estimator.learned_receivers()
    }

    /// The transmitters that its receptions come from, the most probable first; `None` for an
    /// estimator of one transmitter.
    #[must_use]
    pub fn found(&self) -> Option<Vec<FoundTransmitter>> {
        self.estimator.found()
    }

    /// Predicts to the reception's time and conditions the belief on it. For a reception that is
    /// older than the one before no time passes; an estimator that goes back in time, such as
    /// [`OutOfOrder`](foxhunt_filters::OutOfOrder), uses it at its own, where steps count seconds.
    ///
    /// # Errors
    ///
    /// [`TrackError`] when the reception is not an observation or the estimator refuses it. Nothing
    /// was updated then; a prediction may have been made.
    pub fn update(
        &mut self,
        reception: &Reception,
        first_position: bool,
    ) -> Result<TrackStep, TrackError> {
        self.alarm = false;
        // What the turn itself lacks counts, not what `components` strike out.
        if !reception.has_bearing() && self.config.without_bearing == WithoutBearing::Discard {
            return Ok(TrackStep::Skipped);
        }
        let used = self.config.apply_to(reception, first_position);
        let now = self.time.map_or(used.time, |before| before.max(used.time));
        let dt = match self.config.time_step {
            TimeStep::PerReception => 1.0,
            TimeStep::Elapsed => now - self.time.unwrap_or(now),
        };
        let taken = self.estimator.update(dt, &used);
        if taken.as_ref().map_or_else(|untaken| untaken.has_predicted, |_| true) {
            self.time = Some(now);
        }
        let (correction, degrees) = taken.map_err(|untaken| untaken.error)?;
        self.steps += u32::from(correction != Correction::Empty);
        if let Some(last) = self.estimator.remembered().checked_sub(1) {
            self.remembered.push((used.time, last));
        }
        let before = mem::replace(&mut self.health, self.watchdog.observe(&correction, degrees));
        let diverged = |health| matches!(health, NisHealth::Diverged { .. });
        self.alarm = diverged(self.health) && !diverged(before);
        Ok(TrackStep::Updated { correction, degrees_of_freedom: degrees })
    }

    /// Returns the quantities that its estimator measures.
    #[must_use]
    pub fn quantities(&self) -> Vec<Quantity> {
        self.estimator.quantities()
    }

    /// Returns the belief of the beacon's place.
    #[must_use]
    pub fn belief(&self) -> &dyn Belief {
        self.estimator.as_belief()
    }

    /// The first two moments of the beacon's place.
    #[must_use]
    pub fn position(&self) -> Estimate<2> {
        self.estimator.position()
    }

    /// The first two moments of the beacon's place before the first reception.
    #[must_use]
    pub fn prior(&self) -> Estimate<2> {
        self.prior
    }

    /// The consistency of the normalised innovations of the last 10 receptions, at 10⁻⁴
    /// ([`NisWatchdog::default`]).
    pub fn health(&self) -> NisHealth {
        self.health
    }

    /// The consistency, if the last reception was the one at which the filter began to count as
    /// diverged.
    #[must_use]
    pub fn alarm(&self) -> Option<NisHealth> {
        self.alarm.then_some(self.health)
    }

    /// Adds its normalised innovations as one run; none unless it is [monitored](Self::monitored).
    pub fn add_innovations_to(&self, whiteness: &mut Whiteness) {
        self.estimator.add_innovations_to(whiteness);
    }

    /// The time of each reception that went through the estimator, with the place then as all
    /// receptions have it, the later ones included: smoothed ([`Smooth`]).
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Unsupported`] names a setting without a smoother, and a track that is not
    /// [`smoothable`](Self::smoothable).
    pub fn smoothed(&self) -> Result<Vec<(f64, Estimate<2>)>, EstimatorError> {
        let places = self.estimator.smoothed()?;
        let place = |(time, number): &(f64, usize)| Some((*time, *places.get(*number)?));
        Ok(self.remembered.iter().filter_map(place).collect())
    }

    /// Returns the number of receptions that went through the estimator, rejected ones included.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.steps
    }
}

impl std::fmt::Debug for Track {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Track")
            .field("quantities", &self.quantities())
            .field("config", &self.config)
            .field("position", &self.position())
            .field("steps", &self.steps)
            .finish_non_exhaustive()
    }
}

/// The outcome of a reception in a [`Track`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use = "nothing else shows whether the reception was used"]
pub enum TrackStep {
    /// It went through the estimator.
    Updated {
        /// Correction by the estimator.
        correction: Correction,
        /// Number of components that the reception had for it: the degrees of freedom of the
        /// normalised innovation squared. A level of σ 1000 dB or more is not counted.
        degrees_of_freedom: usize,
    },
    /// It has no bearing, and without one it is not used.
    Skipped,
}

/// A transmitter that was found: there are as many as is most probable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FoundTransmitter {
    /// Probability that it is there.
    pub existence: f64,
    /// Estimated place, if it is there.
    pub estimate: Estimate<2>,
}

/// Reason why a reception could not be used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackError {
    /// It is no observation.
    #[error("the reception is not an observation: {0}")]
    Observation(#[from] ObservationError),
    /// The estimator refused it.
    #[error("the estimator cannot use it: {0}")]
    Estimator(#[from] EstimatorError),
}

/// Reason why an estimator did not take a reception.
pub(crate) struct Untaken {
    pub error: TrackError,
    /// True if time has passed for the estimator.
    pub has_predicted: bool,
}

impl Untaken {
    /// The estimator is as it was.
    pub(crate) fn before(error: impl Into<TrackError>) -> Self {
        Self { error: error.into(), has_predicted: false }
    }

    /// The estimator has predicted.
    pub(crate) fn after(error: impl Into<TrackError>) -> Self {
        Self { error: error.into(), has_predicted: true }
    }
}

/// An estimator that takes receptions: its dimensions are hidden.
pub(crate) trait Fed: Belief {
    fn quantities(&self) -> Vec<Quantity>;

    /// Predicts over some time and updates the estimator; returns the correction and its degrees of
    /// freedom. A reception that no observation can be made of is refused before anything is
    /// predicted.
    fn update(&mut self, dt: f64, reception: &Reception) -> Result<(Correction, usize), Untaken>;

    fn as_belief(&self) -> &dyn Belief;

    fn heard_by(&mut self, _receiver: usize) {}

    fn learned_receivers(&self) -> Vec<(usize, LearnedReceiver)> {
        Vec::new()
    }

    fn found(&self) -> Option<Vec<FoundTransmitter>> {
        None
    }

    fn add_innovations_to(&self, _whiteness: &mut Whiteness) {}

    /// Number of the beliefs that are remembered.
    fn remembered(&self) -> usize {
        0
    }

    /// The remembered beliefs, smoothed.
    fn smoothed(&self) -> Result<Vec<Estimate<2>>, EstimatorError> {
        Err(EstimatorError::Unsupported {
            what: "smoothing an estimator that keeps no earlier beliefs",
        })
    }
}

struct Joined<E, I, const N: usize, const M: usize> {
    estimator: E,
    intake: I,
    /// Tells the estimator the receiver of the next receptions.
    hear: fn(&mut E, usize),
    /// Returns the errors that it has learned of each receiver.
    learned: fn(&E) -> Vec<(usize, LearnedReceiver)>,
}

impl<E, I, const N: usize, const M: usize> Joined<E, I, N, M> {
    /// An estimator that takes all receivers for alike.
    fn alike(estimator: E, intake: I) -> Self {
        Self { estimator, intake, hear: |_, _| {}, learned: |_| Vec::new() }
    }
}

impl<E, I, const N: usize, const M: usize> Belief for Joined<E, I, N, M>
where
    E: Estimator<N, M>,
{
    fn position(&self) -> Estimate<2> {
        self.estimator.estimate().position()
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        self.estimator.visit_samples(&mut |state, weight| {
            visit(&state.fixed_rows::<2>(0).into_owned(), weight);
        });
    }
}

impl<E, I, const N: usize, const M: usize> Fed for Joined<E, I, N, M>
where
    E: Estimator<N, M>,
    I: Intake<M>,
{
    fn quantities(&self) -> Vec<Quantity> {
        self.intake.quantities().to_vec()
    }

    fn update(&mut self, dt: f64, reception: &Reception) -> Result<(Correction, usize), Untaken> {
        let observation = self.intake.observation(reception).map_err(Untaken::before)?;
        self.estimator.predict(dt).map_err(Untaken::before)?;
        let Some(observation) = observation else {
            return Ok((Correction::Empty, 0));
        };
        let useless = |component: usize| {
            let level = self.intake.quantities()[component] == Quantity::RSS;
            let sigma = observation.noise()[(component, component)].sqrt();
            level && sigma >= NO_LEVEL_SIGMA_DB
        };
        let degrees = (0..M).filter(|&i| observation.has(i) && !useless(i)).count();
        let correction = self.estimator.update(&observation).map_err(Untaken::after)?;
        Ok((correction, degrees))
    }

    fn as_belief(&self) -> &dyn Belief {
        self
    }

    fn heard_by(&mut self, receiver: usize) {
        (self.hear)(&mut self.estimator, receiver);
    }

    fn learned_receivers(&self) -> Vec<(usize, LearnedReceiver)> {
        (self.learned)(&self.estimator)
    }
}

/// An estimator that keeps its innovations.
struct Watched<E, H, I, const N: usize, const M: usize>(Joined<Monitored<E, H, M>, I, N, M>);

impl<E, H, I, const N: usize, const M: usize> Belief for Watched<E, H, I, N, M>
where
    E: Estimator<N, M>,
    H: MeasurementModel<N, M>,
{
    fn position(&self) -> Estimate<2> {
        self.0.position()
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        self.0.visit_positions(visit);
    }
}

impl<E, H, I, const N: usize, const M: usize> Fed for Watched<E, H, I, N, M>
where
    E: Estimator<N, M>,
    H: MeasurementModel<N, M>,
    I: Intake<M>,
{
    fn quantities(&self) -> Vec<Quantity> {
        self.0.quantities()
    }

    fn update(&mut self, dt: f64, reception: &Reception) -> Result<(Correction, usize), Untaken> {
        self.0.update(dt, reception)
    }

    fn as_belief(&self) -> &dyn Belief {
        self
    }

    fn add_innovations_to(&self, whiteness: &mut Whiteness) {
        whiteness.add_run(self.0.estimator.innovations());
    }
}

/// An estimator that keeps its innovations and its earlier beliefs.
struct Remembered<E, H, I, const N: usize, const M: usize>(Watched<Remembering<E>, H, I, N, M>);

impl<E, H, I, const N: usize, const M: usize> Belief for Remembered<E, H, I, N, M>
where
    E: Estimator<N, M> + Clone,
    H: MeasurementModel<N, M>,
{
    fn position(&self) -> Estimate<2> {
        self.0.position()
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        self.0.visit_positions(visit);
    }
}

impl<E, H, I, const N: usize, const M: usize> Fed for Remembered<E, H, I, N, M>
where
    E: Smooth<N, M> + Clone,
    H: MeasurementModel<N, M>,
    I: Intake<M>,
{
    fn quantities(&self) -> Vec<Quantity> {
        self.0.quantities()
    }

    fn update(&mut self, dt: f64, reception: &Reception) -> Result<(Correction, usize), Untaken> {
        self.0.update(dt, reception)
    }

    fn as_belief(&self) -> &dyn Belief {
        self
    }

    fn add_innovations_to(&self, whiteness: &mut Whiteness) {
        self.0.add_innovations_to(whiteness);
    }

    fn remembered(&self) -> usize {
        self.0.0.estimator.estimator().times()
    }

    fn smoothed(&self) -> Result<Vec<Estimate<2>>, EstimatorError> {
        let smoothed = self.0.0.estimator.estimator().smoothed()?;
        Ok(smoothed.iter().map(|(_, copy)| copy.estimate().position()).collect())
    }
}
