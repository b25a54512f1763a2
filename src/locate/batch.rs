use foxhunt_core::{Estimate, MeasurementModel, Observation, State};
use foxhunt_filters::{BatchError, BatchFix, BatchSolver, Loss};
use foxhunt_sensors::{LogDistance, RssBearing};

use super::{
    LocateConfig, LocateError, Located, Power, Rival,
    area::{Area, free_power, reference_power},
};

/// ν of Student's t (Lange, Little & Taylor 1989).
const DEGREES: f64 = 4.0;

/// Optima with less than this share of the best one's density are not worth a word.
const LEAST_RELATIVE_DENSITY: f64 = 0.01;

/// Everything that was heard, solved once from starts all over the searched area.
pub(super) fn locate(
    observations: &[Observation<2>],
    config: &LocateConfig,
) -> Result<Located, LocateError> {
    let area = Area::about(observations, config.margin_m);
    let (up, starts) = (config.target_up_m, area.starts());
    match config.power {
        Power::Known { reference_dbm, exponent } => {
            let model =
                RssBearing::new(LogDistance::new(reference_dbm, exponent)?).with_target_up(up)?;
            let fix = solve(observations, model, area.prior(), &starts)?;
            Ok(located(observations, &fix))
        }
        Power::Free => {
            let (model, prior) = free_power(observations, &area, up)?;
            let mut with_power = Vec::with_capacity(starts.len());
            for place in starts {
                with_power.push(place.push(reference_power(observations, &place, up)?));
            }
            let fix = solve(observations, model, prior, &with_power)?;
            Ok(located(observations, &fix))
        }
    }
}

fn solve<H, const N: usize>(
    observations: &[Observation<2>],
    model: H,
    prior: Estimate<N>,
    starts: &[State<N>],
) -> Result<BatchFix<N>, LocateError>
where
    H: MeasurementModel<N, 2>,
{
    let solver = BatchSolver::new(model)
        .with_prior(prior)
        .and_then(|solver| solver.with_loss(Loss::StudentT { degrees: DEGREES }))
        .map(BatchSolver::with_inflation);
    let fix: Result<_, BatchError> = solver.and_then(|solver| solver.solve(observations, starts));
    fix.map_err(LocateError::Batch)
}

fn located<const N: usize>(observations: &[Observation<2>], fix: &BatchFix<N>) -> Located {
    let rivals = fix.rivals.iter().map(|(state, log_ratio)| Rival {
        place: state.fixed_rows::<2>(0).into_owned(),
        relative_density: log_ratio.exp(),
    });
    Located {
        observations: observations.iter().filter(|o| !o.is_empty()).count(),
        rivals: rivals.filter(|r| r.relative_density >= LEAST_RELATIVE_DENSITY).collect(),
        ..Located::at(fix.estimate.position())
    }
}
