use foxhunt_core::{Estimate, MeasurementModel, Observation, Receptions, State};
use foxhunt_filters::{BatchFix, BatchSolver, Loss, independent_share};
use foxhunt_sensors::{Censored, LogDistance, RssBearing};
use nalgebra::{DMatrix, Vector2};

use super::{
    LocateConfig, LocateError, Located, Locator, Power,
    area::{Area, free_power, reference_power},
    located::{pairs, regions_with_rivals, rivals, several_places},
};

/// ν of Student's t (Lange, Little & Taylor 1989).
const DEGREES: f64 = 4.0;

/// Residuals of less than this mean square are within their σ, and their pattern is of no account.
const WITHIN_SIGMA: f64 = 0.5;

/// The most probable place given all levels and bearings at once, with residuals as Student's t has
/// them, from nine starts ([`BatchSolver`]). Levels below the receiver's floor are known to lay
/// there. A level counts for as much of an independent one as the residuals of neighbours, and
/// their spread, leave of it ([`independent_share`]); σ of bearings are inflated as they scatter.
#[derive(Clone, Copy, Debug)]
pub struct MultiStart;

impl Locator for MultiStart {
    fn locate(
        &self,
        receptions: &Receptions,
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let area = Area::about(receptions, config.margin_m);
        let up = config.target_up_m;
        let starts = area.lattice(3).collect::<Vec<_>>();
        let observations = pairs(receptions)?;
        let has_levels = receptions.iter().any(|r| r.level.is_some());
        let has_bearings = receptions.iter().any(|r| r.has_bearing());
        // A known power makes a range of a level, and a range and a bearing make a place.
        if !(has_levels && has_bearings && config.power.law().is_some()) {
            let what = if has_bearings { "bearings" } else { "levels" };
            let used = receptions.iter().filter(|r| r.level.is_some() || r.has_bearing());
            several_places(what, used.map(|r| r.receiver))?;
        }
        match config.power {
            Power::Known { reference_dbm, exponent } => {
                let model = RssBearing::new(LogDistance::new(reference_dbm, exponent)?)
                    .with_target_up(up)?;
                let model = Censored::new(model);
                located(&observations, model, area.prior(), &starts)
            }
            Power::Free | Power::FreeReference { .. } | Power::Calibrated(_) => {
                let exponent = config.power.exponent();
                let (model, prior) = free_power(receptions, &area, up, config.power)?;
                let mut with_power = Vec::with_capacity(starts.len());
                for place in starts {
                    with_power.push(place.push(reference_power(receptions, &place, up, exponent)?));
                }
                located(&observations, Censored::new(model), prior, &with_power)
            }
        }
    }
}

fn located<H, const N: usize>(
    observations: &[Observation<2>],
    model: H,
    prior: Estimate<N>,
    starts: &[State<N>],
) -> Result<Located, LocateError>
where
    H: MeasurementModel<N, 2> + Copy,
{
    let solver = BatchSolver::new(model).with_prior(prior)?;
    let solver = solver.with_loss(Loss::StudentT { degrees: DEGREES })?;
    let solver = solver.with_inflation();
    let mut fix = solver.solve(observations, starts)?;
    let share = share_of_levels(observations, &model, &fix);
    if share < 1.0 {
        // Level and bearing of one reception no longer count alike.
        let mut parts = Vec::new();
        let mut counts = Vec::new();
        for observation in observations {
            let level = observation.without(1);
            let bearing = observation.without(0);
            if !level.is_empty() || level.is_censored() {
                parts.push(level);
                counts.push(share);
            }
            if !bearing.is_empty() {
                parts.push(bearing);
                counts.push(1.0);
            }
        }
        fix = solver.solve_counted(&parts, &counts, starts)?;
    }
    let used = |o: &&Observation<2>| !o.is_empty() || o.is_censored();
    Ok(Located {
        observations: observations.iter().filter(used).count(),
        rivals: rivals(&fix.rivals),
        regions_95: regions_with_rivals(&fix),
        ..Located::at(fix.estimate.position())
    })
}

/// Returns the number of independent levels that each level stands for, by the residuals of a fit
/// with its weights. The residuals are in units of their own spread; the fit's inflation takes care
/// of their size.
fn share_of_levels<H, const N: usize>(
    observations: &[Observation<2>],
    model: &H,
    fix: &BatchFix<N>,
) -> f64
where
    H: MeasurementModel<N, 2>,
{
    let state = &fix.estimate.mean;
    let mut places = Vec::new();
    let mut residuals = Vec::new();
    let mut slopes = Vec::new();
    let mut squares = 0.0;
    for (observation, weight) in observations.iter().zip(&fix.weights).filter(|(o, _)| o.has(0)) {
        let receiver = observation.receiver();
        let sigma = observation.noise()[(0, 0)].sqrt();
        let expected = model.expected(state, receiver);
        let place: Vector2<f64> = receiver.position.xy();
        places.push(place);
        let residual = model.residual(observation.value(), &expected)[0] / sigma;
        residuals.push(weight * residual);
        squares += (weight * residual).powi(2);
        slopes.extend(model.jacobian(state, receiver).row(0).iter().map(|slope| slope / sigma));
    }
    let count = f64::from(u32::try_from(residuals.len().max(1)).unwrap_or(u32::MAX));
    let unit = (squares / count).max(WITHIN_SIGMA).sqrt();
    residuals.iter_mut().for_each(|residual| *residual /= unit);
    let jacobian = DMatrix::from_row_slice(residuals.len(), N, &slopes);
    independent_share(&places, &residuals, &jacobian)
}
