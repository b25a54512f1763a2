use foxhunt_core::{Correction, Estimate, Estimator, MeasurementModel, Observation};
use foxhunt_sensors::{FreePowerRssBearing, LogDistance, Propagation, RssBearing};
use nalgebra::Vector2;

use super::{LocateConfig, LocateError, Located, Power};
use crate::{
    config::{EstimatorConfig, with_power},
    hunt::TimeStep,
};

/// The exponent where neither it nor the reference power is known: between free space and
/// clutter (the median of the VHF recordings that the project is tested on).
const FREE_EXPONENT: f64 = 2.3;

/// σ of the reference power before anything was heard, in dB: from a tag to a hand-held radio.
const FREE_POWER_SIGMA_DB: f64 = 20.0;

/// One observation after the other, in the order of time.
pub(super) fn locate(
    observations: &[Observation<2>],
    estimator: &EstimatorConfig,
    config: &LocateConfig,
) -> Result<Located, LocateError> {
    let area = prior(observations, config.margin_m);
    match config.power {
        Power::Known { reference_dbm, exponent } => {
            let model = RssBearing::new(LogDistance::new(reference_dbm, exponent)?)
                .with_target_up(config.target_up_m)?;
            fuse(observations, estimator, model, &area, config.seed)
        }
        Power::Free => {
            let model =
                FreePowerRssBearing::new(FREE_EXPONENT)?.with_target_up(config.target_up_m)?;
            let power = reference_power(observations, &area, config.target_up_m)?;
            let prior = with_power(&area, power, FREE_POWER_SIGMA_DB);
            fuse(observations, estimator, model, &prior, config.seed)
        }
    }
}

fn fuse<H, const N: usize>(
    observations: &[Observation<2>],
    config: &EstimatorConfig,
    model: H,
    prior: &Estimate<N>,
    seed: u64,
) -> Result<Located, LocateError>
where
    H: MeasurementModel<N, 2> + Clone + 'static,
{
    let mut estimator = config.build_over(model, prior, seed).map_err(LocateError::Start)?;
    let (mut used, mut rejected) = (0, 0);
    let mut time = None;
    let mut in_time: Vec<(usize, &Observation<2>)> = observations.iter().enumerate().collect();
    in_time.sort_by(|(_, a), (_, b)| a.time().total_cmp(&b.time()));
    for (index, observation) in in_time {
        let now = observation.time().max(time.unwrap_or(observation.time()));
        let dt = match config.track.time_step {
            TimeStep::PerReception => 1.0,
            TimeStep::Elapsed => now - time.unwrap_or(now),
        };
        time = Some(now);
        let corrected = estimator.predict(dt).and_then(|()| estimator.update(observation));
        match corrected {
            Ok(Correction::Fused { .. }) => used += 1,
            Ok(Correction::Rejected { .. }) => rejected += 1,
            Ok(Correction::Empty) => {}
            Err(source) => {
                let time = observation.time();
                return Err(LocateError::Observation { index, time, source });
            }
        }
    }
    let estimate = estimator.estimate().position();
    Ok(Located { estimate, observations: used, rejected, border_mass: None })
}

/// A Gaussian with the moments of a uniform density over a square that holds every receiver and
/// the margin about them.
fn prior(observations: &[Observation<2>], margin: f64) -> Estimate<2> {
    let places = observations.iter().map(|o| o.receiver().position.xy());
    let (low, high) = places.fold(
        (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY)),
        |(low, high), place| (low.inf(&place), high.sup(&place)),
    );
    let half_side = (high - low).max() / 2.0 + margin;
    Estimate::isotropic((low + high) / 2.0, half_side / 3.0_f64.sqrt())
}

/// The reference power that the levels have on average if the transmitter is at the prior's mean.
fn reference_power(
    observations: &[Observation<2>],
    area: &Estimate<2>,
    up: f64,
) -> Result<f64, LocateError> {
    let unit = LogDistance::new(0.0, FREE_EXPONENT)?;
    let levels: Vec<f64> = observations
        .iter()
        .filter(|o| o.has(0))
        .map(|o| {
            let range = (area.mean.push(up) - o.receiver().position).norm();
            o.value()[0] - unit.rss_dbm(range)
        })
        .collect();
    let count = u32::try_from(levels.len()).unwrap_or(u32::MAX).max(1);
    Ok(levels.iter().sum::<f64>() / f64::from(count))
}
