use std::mem;

use foxhunt_core::{
    BearingModes, Correction, Estimate, Estimator, EstimatorError, Observation, ObservationError,
    Reception,
};
use foxhunt_filters::consistency::{NisHealth, NisWatchdog};
use serde::{Deserialize, Serialize};

/// How receptions are put to an estimator. Hunt and replay share it, so that a replay runs the
/// very same steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrackConfig {
    /// What a prediction's Δt counts; by default seconds.
    pub time_step: TimeStep,
    /// σ of the level in dB while the first formation position of a beacon is measured; the
    /// reading's own where absent, as by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_position_rss_sigma_db: Option<f64>,
    /// σ of the level in dB after that; the reading's own where absent, as by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rss_sigma_db: Option<f64>,
    /// What a reception without a bearing is good for; by default its level is used.
    pub without_bearing: WithoutBearing,
    /// Which of level and bearing are used; by default both.
    pub components: Components,
}

impl TrackConfig {
    /// The reference's (Pritzl 2018, §4.4 and §5.1): a step for every pattern used, σ of the level
    /// 1000 dB at the first formation position and 7.9 dB after it, no pattern without a bearing.
    #[must_use]
    pub const fn pritzl2018() -> Self {
        Self {
            time_step: TimeStep::PerReception,
            first_position_rss_sigma_db: Some(1000.0),
            rss_sigma_db: Some(7.9),
            without_bearing: WithoutBearing::Discard,
            components: Components::Both,
        }
    }

    /// How many components of a reception tell this configuration something: the degrees of
    /// freedom of its normalised innovation squared. A level of σ 1000 dB or more has none.
    #[must_use]
    pub fn degrees_of_freedom(&self, reception: &Reception, first_position: bool) -> usize {
        let seen = self.seen(reception, first_position);
        usize::from(seen.rss_sigma_db < NO_LEVEL_SIGMA_DB) + usize::from(seen.has_bearing())
    }

    /// The reception as this configuration lets the estimator see it.
    fn seen(&self, reception: &Reception, first_position: bool) -> Reception {
        let mut seen = *reception;
        let first = self.first_position_rss_sigma_db.filter(|_| first_position);
        if let Some(sigma) = first.or(self.rss_sigma_db) {
            // The correlation with the bearing stays as it was read.
            seen.covariance *= sigma / seen.rss_sigma_db;
            seen.rss_sigma_db = sigma;
        }
        match self.components {
            Components::Both => {}
            Components::RssOnly => (seen.bearing, seen.modes) = (None, BearingModes::default()),
            Components::BearingOnly => {
                seen.rss_sigma_db = NO_LEVEL_SIGMA_DB;
                seen.covariance = 0.0;
            }
        }
        seen
    }
}

/// What a prediction's Δt counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TimeStep {
    /// Seconds between the receptions.
    #[default]
    Elapsed,
    /// One for every reception, the first included.
    PerReception,
}

/// What a reception without a bearing is good for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WithoutBearing {
    /// Its level is used.
    #[default]
    UseLevel,
    /// Nothing: it makes no step at all.
    Discard,
}

/// Which of level and bearing an estimator gets to see.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Components {
    /// Both.
    #[default]
    Both,
    /// Signal strength alone.
    RssOnly,
    /// Bearings alone: σ of the level becomes 1000 dB (Pritzl 2018, §7).
    BearingOnly,
}

/// σ in dB of a level that says nothing (Pritzl 2018, §4.4).
const NO_LEVEL_SIGMA_DB: f64 = 1000.0;

/// One beacon's estimator and how receptions are put to it.
#[derive(Clone, Debug)]
pub struct Track<E, const N: usize, const M: usize> {
    estimator: E,
    config: TrackConfig,
    time: Option<f64>,
    steps: u32,
    watchdog: NisWatchdog,
    health: NisHealth,
    /// Whether the last reception was the one that made the filter's divergence known.
    alarm: bool,
}

impl<E, const N: usize, const M: usize> Track<E, N, M>
where
    E: Estimator<N, M>,
    Observation<M>: for<'a> TryFrom<&'a Reception, Error = ObservationError>,
{
    /// A track that has heard nothing yet.
    pub fn new(estimator: E, config: TrackConfig) -> Self {
        let watchdog = NisWatchdog::default();
        let (health, alarm) = (watchdog.health(), false);
        Self { estimator, config, time: None, steps: 0, watchdog, health, alarm }
    }

    /// Predicts to the reception's time and conditions the belief on it. For a reception that is
    /// older than the one before no time passes; an estimator that goes back in time, such as
    /// [`OutOfOrder`](foxhunt_filters::OutOfOrder), uses it at its own, where steps count seconds.
    ///
    /// # Errors
    ///
    /// [`TrackError`] when the reception is no observation or the estimator refuses it. Nothing
    /// was updated then; a prediction may have been made.
    pub fn hear(
        &mut self,
        reception: &Reception,
        first_position: bool,
    ) -> Result<Heard, TrackError> {
        self.alarm = false;
        // What the turn itself lacks counts, not what `components` strike out.
        if !reception.has_bearing() && self.config.without_bearing == WithoutBearing::Discard {
            return Ok(Heard::Discarded);
        }
        let used = self.config.seen(reception, first_position);
        let observation = Observation::<M>::try_from(&used)?;
        let now = self.time.map_or(used.time, |before| before.max(used.time));
        let dt = match self.config.time_step {
            TimeStep::PerReception => 1.0,
            TimeStep::Elapsed => now - self.time.unwrap_or(now),
        };
        self.estimator.predict(dt)?;
        self.time = Some(now);
        let correction = self.estimator.update(&observation)?;
        self.steps += u32::from(correction != Correction::Empty);
        let degrees = self.config.degrees_of_freedom(reception, first_position);
        let before = mem::replace(&mut self.health, self.watchdog.observe(&correction, degrees));
        let diverged = |health| matches!(health, NisHealth::Diverged { .. });
        self.alarm = diverged(self.health) && !diverged(before);
        Ok(Heard::Corrected(correction))
    }

    /// The estimator.
    pub fn estimator(&self) -> &E {
        &self.estimator
    }

    /// Where the beacon is believed to be.
    pub fn position(&self) -> Estimate<2> {
        self.estimator.estimate().position()
    }

    /// What the normalised innovations of the last 10 receptions say of the estimator, at 10⁻⁴
    /// ([`NisWatchdog::default`]).
    pub fn health(&self) -> NisHealth {
        self.health
    }

    /// The same if the last reception was the one that made a divergence known.
    pub fn alarm(&self) -> Option<NisHealth> {
        self.alarm.then_some(self.health)
    }

    /// How many receptions went through the estimator, rejected ones included.
    pub fn steps(&self) -> u32 {
        self.steps
    }
}

/// What became of a reception.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use = "whether a reception was used is only told here"]
pub enum Heard {
    /// It went through the estimator.
    Corrected(Correction),
    /// It has no bearing, and without one it is not used.
    Discarded,
}

/// Why a reception could not be used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackError {
    /// It is no observation.
    #[error("the reception is no observation: {0}")]
    Observation(#[from] ObservationError),
    /// The estimator refused it.
    #[error("the estimator cannot use it: {0}")]
    Estimator(#[from] EstimatorError),
}
