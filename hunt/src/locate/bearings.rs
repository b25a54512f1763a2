use foxhunt_core::{Estimate, Reception};
use foxhunt_filters::{
    BatchError, BearingLine, BearingWeights, Lenth1981, instrumental_variables, pseudolinear,
    repeated_median, stansfield,
};

use super::{LocateConfig, LocateError, Located, Locator};

/// Where the bearings meet, whatever their own σ: it follows from how they scatter
/// (`filters::Lenth1981`).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lenth(pub(crate) BearingWeights);

impl Locator for Lenth {
    fn locate(&self, receptions: &[Reception], _: &LocateConfig) -> Result<Located, LocateError> {
        let lines = lines(receptions)?;
        let fix = Lenth1981::maximum_likelihood()
            .with_weights(self.0)
            .and_then(|lenth| lenth.locate(&lines))
            .map_err(LocateError::Bearings)?;
        let rejected = fix.weights.iter().filter(|weight| **weight <= 0.0).count();
        Ok(Located {
            own_ellipse_95: fix.ellipse(0.95),
            observations: lines.len() - rejected,
            rejected,
            ..Located::at(fix.position)
        })
    }
}

/// Where the bearings meet by medians (`filters::repeated_median`).
#[derive(Clone, Copy, Debug)]
pub(crate) struct RepeatedMedian;

impl Locator for RepeatedMedian {
    fn locate(&self, receptions: &[Reception], _: &LocateConfig) -> Result<Located, LocateError> {
        let lines = lines(receptions)?;
        let fix = repeated_median(&lines).map_err(LocateError::Bearings)?;
        Ok(Located { observations: lines.len(), ..Located::at(fix.position) })
    }
}

/// A closed form over bearings, each with its σ.
type Solve = fn(&[(BearingLine, f64)]) -> Result<Estimate<2>, BatchError>;

/// Where the bearings meet, each with its own σ, in closed form.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ClosedForm {
    Pseudolinear,
    Stansfield,
    InstrumentalVariables,
}

impl Locator for ClosedForm {
    fn locate(&self, receptions: &[Reception], _: &LocateConfig) -> Result<Located, LocateError> {
        let weighted: Vec<_> = receptions.iter().filter_map(weighted_line).collect();
        if weighted.is_empty() {
            return Err(LocateError::NoBearings);
        }
        let solve: Solve = match self {
            Self::Pseudolinear => pseudolinear,
            Self::Stansfield => stansfield,
            Self::InstrumentalVariables => instrumental_variables,
        };
        let estimate = solve(&weighted).map_err(LocateError::Bearings)?;
        Ok(Located { observations: weighted.len(), ..Located::at(estimate) })
    }
}

/// A bearing and its σ; of several that compete, their moments.
fn weighted_line(reception: &Reception) -> Option<(BearingLine, f64)> {
    let own = reception.bearing.map(|bearing| (bearing.angle, bearing.sigma));
    let (bearing, sigma) = reception.modes.moments().or(own)?;
    Some((BearingLine { receiver: reception.receiver.position.xy(), bearing }, sigma))
}

fn lines(receptions: &[Reception]) -> Result<Vec<BearingLine>, LocateError> {
    let lines: Vec<_> =
        receptions.iter().filter_map(|r| weighted_line(r).map(|(line, _)| line)).collect();
    if lines.is_empty() { Err(LocateError::NoBearings) } else { Ok(lines) }
}
