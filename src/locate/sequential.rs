use foxhunt_core::{Correction, Estimate, MeasurementModel, Observation};
use foxhunt_sensors::{LogDistance, RssBearing};

use super::{
    LocateConfig, LocateError, Located, Power,
    area::{Area, free_power},
};
use crate::{config::EstimatorConfig, hunt::TimeStep};

/// One observation after the other, in the order of time.
pub(super) fn locate(
    observations: &[Observation<2>],
    estimator: &EstimatorConfig,
    config: &LocateConfig,
) -> Result<Located, LocateError> {
    let area = Area::about(observations, config.margin_m);
    match config.power {
        Power::Known { reference_dbm, exponent } => {
            let model = RssBearing::new(LogDistance::new(reference_dbm, exponent)?)
                .with_target_up(config.target_up_m)?;
            fuse(observations, estimator, model, &area.prior(), config.seed)
        }
        Power::Free => {
            let (model, prior) = free_power(observations, &area, config.target_up_m)?;
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
    Ok(Located { observations: used, rejected, ..Located::at(estimate) })
}
