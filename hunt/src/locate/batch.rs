use foxhunt_core::{Estimate, MeasurementModel, Observation, Reception, State};
use foxhunt_filters::{BatchFix, BatchSolver, Loss};
use foxhunt_sensors::{LogDistance, RssBearing};

use super::{
    LocateConfig, LocateError, Located, Locator, Power, Rival,
    area::{Area, free_power, reference_power},
    located::pairs,
};

/// ν of Student's t (Lange, Little & Taylor 1989).
const DEGREES: f64 = 4.0;

/// Optima with less than this share of the best one's density are not reported.
const LEAST_RELATIVE_DENSITY: f64 = 0.01;

/// The most probable place given all levels and bearings at once, with residuals as Student's t has
/// them and all σ inflated as they scatter, from nine starts ([`BatchSolver`]).
///
/// It takes errors for independent: its ellipse is much too small where neighbouring levels fade
/// alike, as along a flight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MultiStart;

impl Locator for MultiStart {
    fn locate(
        &self,
        receptions: &[Reception],
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let area = Area::about(receptions, config.margin_m);
        let up = config.target_up_m;
        let starts = area.lattice(3).collect::<Vec<_>>();
        let observations = pairs(receptions)?;
        match config.power {
            Power::Known { reference_dbm, exponent } => {
                let model = RssBearing::new(LogDistance::new(reference_dbm, exponent)?)
                    .with_target_up(up)?;
                Ok(located(&observations, &solve(&observations, model, area.prior(), &starts)?))
            }
            Power::Free | Power::FreeReference { .. } => {
                let exponent = config.power.exponent();
                let (model, prior) = free_power(receptions, &area, up, exponent)?;
                let mut with_power = Vec::with_capacity(starts.len());
                for place in starts {
                    with_power.push(place.push(reference_power(receptions, &place, up, exponent)?));
                }
                Ok(located(&observations, &solve(&observations, model, prior, &with_power)?))
            }
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
    Ok(solver?.solve(observations, starts)?)
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
