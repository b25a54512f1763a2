use std::sync::Arc;

use foxhunt_core::{
    ConstantVelocity, Estimate, EstimatorError, MeasurementModel, RandomWalk, State,
    parameter::{not_negative, positive, require},
};
use foxhunt_filters::{GridConfig, GridFilter, Handover, Leading, OutOfOrder, RaoBlackwellised};
use foxhunt_sensors::{
    FreePathLossRssBearing, FreePowerRssBearing, LogDistance, OverTerrain, RssBearing,
    SharedTerrain, WithElevationPattern,
};
use nalgebra::Vector4;
use serde::{Deserialize, Serialize};

use crate::{
    AnyModel, AnyMotion, BoxedEstimator, Components, FilterConfig, FilterOf, TimeStep, Track,
    TrackConfig,
    filter::{generator, grid_config},
    several::{Several, SeveralConfig},
    team::{ReceiversConfig, Team},
};

/// A model of signal strength and bearing, as hunts have it.
pub type ReceiverModel = OverTerrain<WithElevationPattern<RssBearing<LogDistance>>, SharedTerrain>;

/// An estimator: a filter, what it takes for known, and how receptions are put to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorConfig {
    /// The filter.
    pub filter: FilterConfig,
    /// The random walk of the beacon's East and North: metres per √second, or per step where a
    /// prediction counts steps.
    pub drift: f64,
    /// σ of each coordinate of a beacon's place before the first reception, in metres, where the
    /// estimator has its own; the hunt's where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior_sigma_m: Option<f64>,
    /// σ in dB of the model's reference power, which is then estimated along with the place; known
    /// where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power_sigma_db: Option<f64>,
    /// σ of the model's path-loss exponent, which is then estimated along with the reference
    /// power; known where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exponent_sigma: Option<f64>,
    /// Offsets of each receiver's levels and bearings, which are then estimated along with the
    /// reference power on a grid, and each receiver's own σ; all receivers are alike where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub receivers: Option<ReceiversConfig>,
    /// An unknown number of transmitters on one frequency, each with the filter for itself; one
    /// where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub several: Option<SeveralConfig>,
    /// Motion of the beacon; it stays where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moving: Option<MovingConfig>,
    /// Greatest delay, in seconds, at which a late reception is used at its own time; where absent,
    /// a late reception is used as if it were new.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lag_s: Option<f64>,
    /// Number of observations after which the filter begins, from what a grid made of them; at once
    /// where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_on_grid: Option<u32>,
    /// Way in which receptions are put to it; everything as it was read unless given.
    #[serde(default)]
    pub track: TrackConfig,
}

/// A beacon that moves at a nearly constant velocity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MovingConfig {
    /// q in m²/s³: the power spectral density of the acceleration on each axis.
    pub spectral_density: f64,
    /// σ of the velocity's East and North before the first reception, in m/s.
    pub speed_sigma: f64,
}

/// The random walk of an unknown reference power in dB per √second: enough that a particle filter
/// does not freeze on its first draws.
const POWER_DRIFT: f64 = 0.02;

/// The random walk of an unknown exponent per √second, for the same reason.
const EXPONENT_DRIFT: f64 = 0.001;

/// The random walk that logs of moving beacons hold, in which it changes nothing.
const UNUSED_DRIFT: f64 = 0.02;

impl EstimatorConfig {
    /// Returns its belief before the first reception: the hunt's, with a σ of its own where it has
    /// one.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when its own σ is not positive.
    pub fn prior(&self, hunt: &Estimate<2>) -> Result<Estimate<2>, EstimatorError> {
        Ok(match self.prior_sigma_m {
            Some(sigma) => Estimate::isotropic(hunt.mean, positive("prior_sigma_m", sigma)?),
            None => *hunt,
        })
    }

    /// Builds the track of a beacon over a model of level and bearing from what the hunt believes;
    /// `seed` is for filters that draw random numbers. With `monitored` it keeps its innovations.
    ///
    /// # Errors
    ///
    /// [`EstimatorError`] when the prior or a parameter does not make one.
    pub fn track(
        &self,
        model: impl Into<ReceiverModel>,
        prior: &Estimate<2>,
        seed: u64,
        monitored: bool,
    ) -> Result<Track, EstimatorError> {
        self.track.check()?;
        let model = model.into();
        if let Some(receivers) = &self.receivers {
            let own = self.prior(prior)?;
            let team = self.build_team(receivers, &model, own)?;
            return Ok(Track::of_team(team, self.track).with_prior(own));
        }
        if let Some(several) = self.several {
            return self.track_of_several(several, model, prior, seed);
        }
        let estimator = self.build(model.clone(), prior, seed)?;
        let track = if monitored {
            Track::monitored::<2, 2>(estimator, model, self.track)
        } else {
            Track::new::<2, 2>(estimator, self.track)
        };
        Ok(track.with_prior(self.prior(prior)?))
    }

    /// Builds a track as [`track`](Self::track) does, one that keeps its innovations and the
    /// beliefs that [`Track::smoothed`] goes back over.
    ///
    /// # Errors
    ///
    /// The errors of [`track`](Self::track).
    pub fn smoothable_track(
        &self,
        model: impl Into<ReceiverModel>,
        prior: &Estimate<2>,
        seed: u64,
    ) -> Result<Track, EstimatorError> {
        self.track.check()?;
        let model = model.into();
        if self.receivers.is_some() || self.several.is_some() {
            return self.track(model, prior, seed, false);
        }
        let estimator = self.build(model.clone(), prior, seed)?;
        let track = Track::smoothable::<2, 2>(estimator, model, self.track);
        Ok(track.with_prior(self.prior(prior)?))
    }

    /// Builds the estimator of a beacon's place from a model of level and bearing and the hunt's
    /// prior; `seed` is for filters that draw random numbers.
    ///
    /// # Errors
    ///
    /// [`EstimatorError`] when the prior or a parameter does not make one.
    pub fn build(
        &self,
        model: impl Into<ReceiverModel>,
        prior: &Estimate<2>,
        seed: u64,
    ) -> Result<BoxedEstimator<2, 2>, EstimatorError> {
        if self.several.is_some() {
            return Err(EstimatorError::Unsupported {
                what: "several transmitters (several) where one place is asked for",
            });
        }
        let prior = self.prior(prior)?;
        let model = model.into();
        if let Some(receivers) = &self.receivers {
            return Ok(Box::new(self.build_team(receivers, &model, prior)?));
        }
        let estimator = self.build_in_order(model, &prior, seed)?;
        let Some(lag_s) = self.lag_s else { return Ok(estimator) };
        if self.track.time_step == TimeStep::PerReception {
            return Err(EstimatorError::Unsupported {
                what: "lag_s where time counts receptions, not seconds,",
            });
        }
        Ok(Box::new(OutOfOrder::from_first(estimator, lag_s)?))
    }

    /// The estimator of receptions that come in the order of their time.
    fn build_in_order(
        &self,
        model: ReceiverModel,
        prior: &Estimate<2>,
        seed: u64,
    ) -> Result<BoxedEstimator<2, 2>, EstimatorError> {
        let cliffs = model.loss().is_some();
        let place: AnyModel<2, 2> = shared(model.clone());
        if let Some(moving) = self.moving {
            if self.power_sigma_db.is_some() || self.exponent_sigma.is_some() {
                return Err(EstimatorError::Unsupported {
                    what: "an unknown power or exponent (power_sigma_db, exponent_sigma) with a \
                           beacon that may move (moving)",
                });
            }
            return self.build_moving(place, shared(model), moving, prior, seed);
        }
        let is_cloud = matches!(self.filter, FilterConfig::RaoBlackwellised { .. });
        if is_cloud && (self.exponent_sigma.is_some() || self.start_on_grid.is_some()) {
            return Err(EstimatorError::Unsupported {
                what: "a Rao-Blackwellised cloud with an unknown exponent or begun on a grid \
                       (exponent_sigma, start_on_grid)",
            });
        }
        let law = *model.model().model().propagation();
        let power_sigma = self.power_sigma_db.map(|s| positive("power_sigma_db", s)).transpose()?;
        let exponent_sigma =
            self.exponent_sigma.map(|s| positive("exponent_sigma", s)).transpose()?;
        match (power_sigma, exponent_sigma) {
            (None, None) => self.build_over(place, cliffs, prior, seed),
            (Some(sigma), None) => {
                let prior = with_power(prior, law.reference_dbm(), sigma);
                let model = model.map(|model| model.map(FreePowerRssBearing::from));
                if let FilterConfig::RaoBlackwellised { count } = self.filter {
                    let rng = generator(count, seed)?;
                    let cloud: RaoBlackwellised<_, _, _, 3, 2, 1> =
                        RaoBlackwellised::new(self.walk()?, model, prior, count, rng)?;
                    return Ok(Box::new(Leading::new(cloud)));
                }
                let filter = self.build_over::<3, 2>(shared(model), cliffs, &prior, seed)?;
                Ok(Box::new(Leading::new(filter)))
            }
            (Some(sigma), Some(exponent_sigma)) => {
                let place = with_power(prior, law.reference_dbm(), sigma);
                let mean = place.mean.push(law.exponent());
                let mut prior = Estimate::isotropic(mean, exponent_sigma);
                prior.covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&place.covariance);
                let free = FreePathLossRssBearing::new();
                let free = free.with_target_up(model.model().model().target_up())?;
                let model = model.map(|model| model.map(|_| free));
                let filter = self.build_over::<4, 2>(shared(model), cliffs, &prior, seed)?;
                Ok(Box::new(Leading::new(filter)))
            }
            (None, Some(_)) => Err(EstimatorError::Unsupported {
                what: "an unknown exponent (exponent_sigma) with a known power",
            }),
        }
    }

    /// The track of several transmitters, each with this filter for itself.
    fn track_of_several(
        &self,
        several: SeveralConfig,
        model: ReceiverModel,
        prior: &Estimate<2>,
        seed: u64,
    ) -> Result<Track, EstimatorError> {
        let one = Self { several: None, ..*self };
        if one.receivers.is_some() || one.lag_s.is_some() {
            return Err(EstimatorError::Unsupported {
                what: "several transmitters (several) with offsets of receivers or late receptions \
                       (receivers, lag_s)",
            });
        }
        if one.track.components == Components::RssOnly {
            return Err(EstimatorError::Unsupported {
                what: "several transmitters (several) by levels alone",
            });
        }
        let own = self.prior(prior)?;
        let several = Several::new(several, one.build(model, prior, seed)?)?;
        Ok(Track::of(several, self.track).with_prior(own))
    }

    /// The estimator of the place, the reference power and each receiver's offsets.
    fn build_team(
        &self,
        receivers: &ReceiversConfig,
        model: &ReceiverModel,
        prior: Estimate<2>,
    ) -> Result<Team, EstimatorError> {
        let unsupported = |what| Err(EstimatorError::Unsupported { what });
        let FilterConfig::Grid { side, level_noise_spread: None } = self.filter else {
            return unsupported(
                "offsets of receivers (receivers) with another filter than a grid whose levels \
                 have the σ that they state (without level_noise_spread)",
            );
        };
        if self.several.is_some() {
            return unsupported(
                "offsets of receivers (receivers) with several transmitters (several)",
            );
        }
        let Some(sigma) = self.power_sigma_db else {
            return unsupported("offsets of receivers (receivers) with a known power");
        };
        if self.exponent_sigma.is_some() || self.moving.is_some() || self.lag_s.is_some() {
            return unsupported(
                "offsets of receivers (receivers) with an unknown exponent, a beacon that may \
                 move or late receptions (exponent_sigma, moving, lag_s)",
            );
        }
        if self.start_on_grid.is_some() {
            return unsupported("offsets of receivers (receivers) with start_on_grid");
        }
        let law = *model.model().model().propagation();
        let sigma = positive("power_sigma_db", sigma)?;
        let prior = with_power(&prior, law.reference_dbm(), sigma);
        let cliffs = model.loss().is_some();
        let cells = GridConfig { cliffs, ..grid_config(side, None)? };
        let model = model.clone().map(|model| model.map(FreePowerRssBearing::from));
        Team::new(receivers, shared(model), &self.walk()?, &prior, cells)
    }

    /// Builds the estimator of a state that begins with the place and otherwise does not move, over
    /// a model whose level has `cliffs` or not.
    fn build_over<const N: usize, const M: usize>(
        &self,
        model: AnyModel<N, M>,
        cliffs: bool,
        prior: &Estimate<N>,
        seed: u64,
    ) -> Result<BoxedEstimator<N, M>, EstimatorError>
    where
        FilterConfig: FilterOf<N, M>,
    {
        let filter = self.filter;
        let walk: AnyMotion<N> = Arc::new(self.walk()?);
        if cliffs && let Some(config) = filter.grid_with_cliffs()? {
            return Ok(Box::new(GridFilter::new(walk, model, *prior, config)?));
        }
        let Some(observations) = self.start_on_grid else {
            return filter.build(walk, model, prior, seed);
        };
        // What cannot be built fails now, not after the first observations.
        let _ = filter.build(Arc::clone(&walk), Arc::clone(&model), prior, seed)?;
        let config = GridConfig { cliffs, ..GridConfig::default() };
        let grid = GridFilter::new(Arc::clone(&walk), Arc::clone(&model), *prior, config)?;
        let build = move |first: Estimate<N>| {
            filter.build(Arc::clone(&walk), Arc::clone(&model), &first, seed)
        };
        Ok(Box::new(Handover::new(grid, observations, build)))
    }

    /// Builds the estimator of a place and its velocity; of the place alone until it has started
    /// from a grid.
    fn build_moving(
        &self,
        place_model: AnyModel<2, 2>,
        model: AnyModel<4, 2>,
        moving: MovingConfig,
        prior: &Estimate<2>,
        seed: u64,
    ) -> Result<BoxedEstimator<2, 2>, EstimatorError> {
        let one_place = match self.filter {
            FilterConfig::Grid { .. } => Some("a grid with a beacon that may move (moving)"),
            FilterConfig::DualEkf { .. } => {
                Some("two Kalman filters with a beacon that may move (moving)")
            }
            #[cfg(feature = "batch")]
            FilterConfig::Batch { .. } => Some("a batch with a beacon that may move (moving)"),
            _ => None,
        };
        if let Some(what) = one_place {
            return Err(EstimatorError::Unsupported { what });
        }
        let unused = [0.0, UNUSED_DRIFT].contains(&self.drift);
        require(unused, "drift", self.drift, "0: a beacon that moves (moving) has no random walk")?;
        let speed_sigma = positive("speed_sigma", moving.speed_sigma)?;
        let spectral_density = positive("spectral_density", moving.spectral_density)?;
        let motion: AnyMotion<4> = Arc::new(ConstantVelocity { spectral_density });
        let filter = self.filter;
        let build = move |place: Estimate<2>| {
            let still = Vector4::new(place.mean.x, place.mean.y, 0.0, 0.0);
            let mut prior = Estimate::isotropic(still, speed_sigma);
            prior.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place.covariance);
            let whole = filter.build(Arc::clone(&motion), Arc::clone(&model), &prior, seed)?;
            Ok(Leading::<_, 4>::new(whole))
        };
        let whole = build(*prior)?;
        let Some(observations) = self.start_on_grid else { return Ok(Box::new(whole)) };
        // On the grid the target walks as far in a second as its velocity may take it.
        let walk: AnyMotion<2> = Arc::new(RandomWalk::uniform(speed_sigma));
        let grid = GridFilter::new(walk, place_model, *prior, GridConfig::default())?;
        Ok(Box::new(Handover::new(grid, observations, build)))
    }

    /// The random walk of East, North and what stands behind them in the state, such as a
    /// reference power.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the drift is negative or not finite.
    pub fn walk<const N: usize>(&self) -> Result<RandomWalk<N>, EstimatorError> {
        let place = not_negative("drift", self.drift)?;
        let drift = State::from_fn(|row, _| match row {
            0 | 1 => place,
            2 => POWER_DRIFT,
            _ => EXPONENT_DRIFT,
        });
        Ok(RandomWalk { drift })
    }
}

/// A place and, independent of it, a reference power in dBm.
fn with_power(place: &Estimate<2>, reference_dbm: f64, sigma_db: f64) -> Estimate<3> {
    let mut prior = Estimate::isotropic(place.mean.push(reference_dbm), sigma_db);
    prior.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place.covariance);
    prior
}

/// The model of an estimator: over level ground the one inside, which is quicker.
fn shared<H, const N: usize, const M: usize>(model: OverTerrain<H, SharedTerrain>) -> AnyModel<N, M>
where
    H: MeasurementModel<N, M> + Clone + 'static,
{
    match model.loss() {
        Some(_) => Arc::new(model),
        None => Arc::new(model.model().clone()),
    }
}
