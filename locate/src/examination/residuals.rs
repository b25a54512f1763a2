use std::collections::BTreeSet;

use foxhunt_core::{Reception, Receptions, angle};
use nalgebra::Vector2;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use super::{
    super::{LocateConfig, Located},
    fit::{Datum, Kind, meeting, normal},
    shared::{Uses, data, scale},
};

/// Measurement that took part in an answer, with its residual from the place of the answer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Residual {
    /// Index of the reception, from 0.
    pub reception: usize,
    /// Quantity that was measured.
    pub kind: Measurand,
    /// Measured minus expected, in the unit of the kind; of a level at a limit the distance by
    /// which the expected level lies on the wrong side of that limit.
    pub residual: f64,
    /// Probability of a residual as large, where the other measurements can tell.
    pub p: Option<f64>,
    /// True if the measurement did not count: an outlier, or one that a gate kept out.
    pub left_out: bool,
}

/// Quantity of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measurand {
    /// Bearing; residuals in radians counter-clockwise.
    Bearing,
    /// Range; residuals in metres.
    Range,
    /// Range difference; residuals in metres.
    RangeDifference,
    /// Level; residuals in dB.
    Level,
    /// Silence of a receiver, below its floor; residuals in dB.
    Silence,
    /// Level at a receiver's ceiling, or above; residuals in dB.
    Saturation,
}

impl From<Kind> for Measurand {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Bearing => Self::Bearing,
            Kind::Range => Self::Range,
            Kind::Difference(_) => Self::RangeDifference,
        }
    }
}

/// Share of a measurement's variance that the others have to leave for its residual to be tested.
const LEAST_SPARE: f64 = 0.05;

/// Returns the residuals of bearings, ranges and differences. Each is tested by σ of the
/// measurement and of the receiver's place, as the scatter of the others corrects it (the
/// externally studentised residual: Cook & Weisberg 1982, ch. 2).
pub(super) fn of_geometry(
    located: &Located,
    receptions: &Receptions,
    config: &LocateConfig,
    uses: Uses,
    left_out: &BTreeSet<usize>,
) -> Vec<Residual> {
    let up = config.target_up_m;
    let place: Vector2<f64> = located.estimate.mean;
    let data = data(receptions, config, uses, located.range_bias);
    let is_out = |datum: &Datum| left_out.contains(&datum.reception);
    let rest: Vec<Datum> = data.iter().filter(|datum| !is_out(datum)).copied().collect();
    let factor = normal(&rest, &place, up).0.cholesky();
    let misfit = meeting(&rest, up).map_or(0.0, |meeting| meeting.misfit);
    let scale = scale(&rest, config);
    let test = |over_sigma: f64, leverage: f64, left_out: bool| {
        // The place owes a part of itself to a row that counts, and nothing to one left out.
        let spare = if left_out { 1.0 + leverage } else { 1.0 - leverage };
        if spare <= LEAST_SPARE {
            return None;
        }
        let own = if left_out { 0.0 } else { over_sigma.powi(2) / spare };
        let others = rest.len().saturating_sub(usize::from(!left_out));
        let (square, degrees) = scale.of((misfit - own).max(0.0), others);
        let law = StudentsT::new(0.0, 1.0, degrees).ok()?;
        Some(2.0 * law.sf((over_sigma / (square * spare).sqrt()).abs()))
    };
    let residual = |datum: &Datum| {
        let left_out = is_out(datum);
        let over_sigma = datum.residual(&place, up);
        let slope = datum.slope(&place, up);
        let leverage = factor.as_ref().map(|factor| slope.dot(&factor.solve(&slope)));
        Residual {
            reception: datum.reception,
            kind: datum.kind.into(),
            residual: over_sigma * datum.sigma_towards(&place, up),
            p: leverage.and_then(|leverage| test(over_sigma, leverage, left_out)),
            left_out,
        }
    };
    data.iter().map(residual).collect()
}

/// Returns the residual of the nearest of the directions that compete for a bearing, in radians;
/// `None` for a bearing of one direction.
pub(crate) fn of_nearest_mode(received: &Reception, place: &Vector2<f64>) -> Option<f64> {
    let way = place - received.receiver.position.xy();
    let towards = libm::atan2(way.y, way.x);
    let apart = received.modes.as_slice().iter().map(|mode| angle::wrap(mode.angle - towards));
    apart.min_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// Returns the probability of a deviation of a normal distribution as large, on either side.
pub(crate) fn two_sided(deviation: f64) -> Option<f64> {
    let law = Normal::new(0.0, 1.0).ok()?;
    Some(2.0 * law.sf(deviation.abs()))
}

/// Returns the probability of a deviation of a normal distribution as large, on one side.
pub(super) fn one_sided(deviation: f64) -> Option<f64> {
    let law = Normal::new(0.0, 1.0).ok()?;
    Some(law.sf(deviation))
}
