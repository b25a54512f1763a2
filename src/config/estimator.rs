use foxhunt_core::{
    ConstantVelocity, Estimate, EstimatorError, MeasurementModel, RandomWalk, State,
};
use foxhunt_filters::{GridConfig, GridFilter, Handover, Leading, OutOfOrder, RaoBlackwellised};
use foxhunt_sensors::FreePowerRssBearing;
use nalgebra::Vector4;
use serde::{Deserialize, Serialize};

use super::{BoxedEstimator, FilterConfig, ReceiverModel, filter::generator};
use crate::hunt::{TimeStep, TrackConfig};

/// An estimator: a filter, what it takes for known, and how receptions are put to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorConfig {
    /// The filter.
    pub filter: FilterConfig,
    /// The random walk of the beacon's East and North: metres per √second, or per step where a
    /// prediction counts steps.
    pub drift: f64,
    /// σ of each coordinate of a beacon's place before anything was heard, in metres, where the
    /// estimator has its own; the hunt's where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior_sigma_m: Option<f64>,
    /// σ in dB of the model's reference power, which is then found along with the place; known
    /// where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power_sigma_db: Option<f64>,
    /// How the beacon moves, where it does; it stays where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moving: Option<MovingConfig>,
    /// A reception that comes at most so many seconds late is used at its own time; one that comes
    /// late is used as if it were new where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lag_s: Option<f64>,
    /// The filter begins after so many observations, from what a grid made of these; at once
    /// where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_on_grid: Option<u32>,
    /// How receptions are put to it; everything as it was read unless given.
    #[serde(default)]
    pub track: TrackConfig,
}

/// A beacon that moves at a nearly constant velocity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MovingConfig {
    /// √q: the root of the acceleration's spectral density, in m s⁻² per √Hz.
    pub acceleration_density: f64,
    /// σ of the velocity's East and North before anything was heard, in m/s.
    pub speed_sigma: f64,
}

/// The random walk of an unknown reference power in dB per √second: enough that a particle filter
/// does not freeze on its first draws.
const POWER_DRIFT: f64 = 0.02;

impl EstimatorConfig {
    /// Builds the estimator of a beacon's place from the law of propagation and the hunt's prior;
    /// `seed` is for filters that draw random numbers.
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
        let prior = match self.prior_sigma_m {
            Some(sigma) => Estimate::isotropic(prior.mean, positive("prior_sigma_m", sigma)?),
            None => *prior,
        };
        let estimator = self.build_in_order(model.into(), &prior, seed)?;
        let Some(value) = self.lag_s else { return Ok(estimator) };
        if self.track.time_step == TimeStep::PerReception {
            let (name, requirement) = ("lag_s", "absent where time counts receptions, not seconds");
            return Err(EstimatorError::Parameter { name, value, requirement });
        }
        Ok(Box::new(OutOfOrder::from_first(estimator, value)?))
    }

    /// The estimator of receptions that come in the order of their time.
    fn build_in_order(
        &self,
        model: ReceiverModel,
        prior: &Estimate<2>,
        seed: u64,
    ) -> Result<BoxedEstimator<2, 2>, EstimatorError> {
        if let Some(moving) = self.moving {
            if let Some(value) = self.power_sigma_db {
                let (name, requirement) = ("power_sigma_db", "absent for a beacon that may move");
                return Err(EstimatorError::Parameter { name, value, requirement });
            }
            return self.build_moving(model, moving, prior, seed);
        }
        let Some(power_sigma_db) = self.power_sigma_db else {
            return self.build_over(model, prior, seed);
        };
        let sigma = positive("power_sigma_db", power_sigma_db)?;
        let prior = with_power(prior, model.model().propagation().reference_dbm(), sigma);
        let model = model.map(FreePowerRssBearing::from);
        if let FilterConfig::RaoBlackwellised { count } = self.filter {
            let rng = generator(count, seed)?;
            let cloud: RaoBlackwellised<_, _, _, 3, 2, 1> =
                RaoBlackwellised::new(self.walk()?, model, prior, count, rng)?;
            return Ok(Box::new(Leading::new(cloud)));
        }
        let filter = self.build_over(model, &prior, seed)?;
        Ok(Box::new(Leading::new(filter)))
    }

    /// Builds the estimator of a state that begins with the place and otherwise does not move,
    /// over any model.
    ///
    /// # Errors
    ///
    /// [`EstimatorError`] when the prior or a parameter does not make one.
    pub fn build_over<H, const N: usize, const M: usize>(
        &self,
        model: H,
        prior: &Estimate<N>,
        seed: u64,
    ) -> Result<BoxedEstimator<N, M>, EstimatorError>
    where
        H: MeasurementModel<N, M> + Clone + 'static,
    {
        let (walk, filter) = (self.walk()?, self.filter);
        let Some(observations) = self.start_on_grid else {
            return filter.build(walk, model, prior, seed);
        };
        // What cannot be built says so now, not after the first observations.
        let _ = filter.build::<_, _, N, M>(walk, model.clone(), prior, seed)?;
        let grid = GridFilter::new(walk, model.clone(), *prior, GridConfig::default())?;
        let build = move |first| filter.build(walk, model.clone(), &first, seed);
        Ok(Box::new(Handover::new(grid, observations, build)))
    }

    /// Builds the estimator of a place and its velocity; of the place alone until it has started
    /// from a grid.
    fn build_moving(
        &self,
        model: ReceiverModel,
        moving: MovingConfig,
        prior: &Estimate<2>,
        seed: u64,
    ) -> Result<BoxedEstimator<2, 2>, EstimatorError> {
        let speed_sigma = positive("speed_sigma", moving.speed_sigma)?;
        let acceleration_density = positive("acceleration_density", moving.acceleration_density)?;
        let (motion, filter) = (ConstantVelocity { acceleration_density }, self.filter);
        let moved = model.clone();
        let build = move |place: Estimate<2>| {
            let still = Vector4::new(place.mean.x, place.mean.y, 0.0, 0.0);
            let mut prior = Estimate::isotropic(still, speed_sigma);
            prior.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place.covariance);
            Ok(Leading::<_, 4>::new(filter.build(motion, moved.clone(), &prior, seed)?))
        };
        let whole = build(*prior)?;
        let Some(observations) = self.start_on_grid else { return Ok(Box::new(whole)) };
        // On the grid the target walks as far in a second as its velocity may take it.
        let walk = RandomWalk::uniform(speed_sigma);
        let grid = GridFilter::new(walk, model, *prior, GridConfig::default())?;
        Ok(Box::new(Handover::new(grid, observations, build)))
    }

    /// The random walk of East, North and what stands behind them in the state, such as a
    /// reference power.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the drift is negative or not finite.
    pub fn walk<const N: usize>(&self) -> Result<RandomWalk<N>, EstimatorError> {
        let value = self.drift;
        if !(value >= 0.0 && value.is_finite()) {
            let (name, requirement) = ("drift", "a non-negative number");
            return Err(EstimatorError::Parameter { name, value, requirement });
        }
        let drift = State::from_fn(|row, _| if row < 2 { value } else { POWER_DRIFT });
        Ok(RandomWalk { drift })
    }
}

fn positive(name: &'static str, value: f64) -> Result<f64, EstimatorError> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(EstimatorError::Parameter { name, value, requirement: "a positive number" })
    }
}

/// A place and, independent of it, a reference power in dBm.
pub(crate) fn with_power(place: &Estimate<2>, reference_dbm: f64, sigma_db: f64) -> Estimate<3> {
    let mut prior = Estimate::isotropic(place.mean.push(reference_dbm), sigma_db);
    prior.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place.covariance);
    prior
}

#[cfg(test)]
mod tests {
    use foxhunt_sensors::{LogDistance, RssBearing};
    use nalgebra::Vector2;

    use super::*;
    use crate::config::estimator_named;

    #[test]
    fn settings_that_would_not_be_used_are_refused() {
        let model = RssBearing::new(LogDistance::new(-29.06, 2.765).expect("in range"));
        let prior = Estimate::isotropic(Vector2::zeros(), 10.0);
        let config = |name| estimator_named(name).expect("it has a name").config;
        let refused = |config: EstimatorConfig| match config.build(model, &prior, 1).err() {
            Some(EstimatorError::Parameter { name, .. }) => Some(name),
            other => panic!("{other:?}"),
        };
        let late = EstimatorConfig { lag_s: Some(5.0), ..config("ukf-pritzl2018") };
        assert_eq!(refused(late), Some("lag_s"));
        let moving = EstimatorConfig { power_sigma_db: Some(5.0), ..config("imm") };
        assert_eq!(refused(moving), Some("power_sigma_db"));
        let cloud =
            EstimatorConfig { power_sigma_db: None, ..config("particle-rao-blackwellised") };
        assert_eq!(refused(cloud), Some("components of the state"));
        let seconds = EstimatorConfig { lag_s: Some(5.0), ..config("ukf") };
        assert!(seconds.build(model, &prior, 1).is_ok());
    }
}
