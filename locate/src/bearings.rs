use foxhunt_core::{Estimate, Reception, Receptions};
use foxhunt_filters::{
    BatchError, BearingGrid, BearingGridFix, BearingLine, BearingWeights, Lenth1981, Marginal,
    instrumental_variables, pseudolinear, repeated_median, stansfield,
};

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{
    CommonErrors, LocateConfig, LocateError, Located, Locator, StationError, examination,
    located::{receiver_sigma_m, several_places},
    region::regions,
};

/// Meeting point of the bearings, whose common σ is estimated from their scatter; their own σ are
/// ignored (`filters::Lenth1981`).
#[derive(Clone, Copy, Debug)]
pub struct Lenth(pub BearingWeights);

impl Locator for Lenth {
    fn locate(&self, receptions: &Receptions, _: &LocateConfig) -> Result<Located, LocateError> {
        let lines = lines(receptions)?;
        let fix = Lenth1981::maximum_likelihood()
            .with_weights(self.0)
            .and_then(|lenth| lenth.locate(&lines))
            .map_err(LocateError::Bearings)?;
        let bearings = receptions.iter().enumerate().filter(|(_, r)| weighted_line(r).is_some());
        let weighted = bearings.zip(&fix.weights);
        let left_out: Vec<usize> =
            weighted.filter(|(_, weight)| **weight <= 0.0).map(|((index, _), _)| index).collect();
        let rejected = left_out.len();
        Ok(Located {
            own_ellipse_95: fix.ellipse(0.95),
            observations: lines.len() - rejected,
            rejected,
            left_out,
            ..Located::at(fix.position)
        })
    }
}

/// Posterior of the place under bearings whose σ is known up to a common factor; bearings from one
/// place may share an error (`filters::BearingGrid`).
#[derive(Clone, Copy, Debug)]
pub struct Posterior;

impl Locator for Posterior {
    fn locate(
        &self,
        receptions: &Receptions,
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let of_bearings = receptions.iter().filter(Reception::has_bearing);
        several_places("bearings", of_bearings.map(|r| r.receiver))?;
        let (fix, count) = posterior(receptions, config)?;
        let mode = fix.mode;
        let map = match receiver_sigma_m(receptions) {
            sigma_m if sigma_m > 0.0 => fix.map.blurred(sigma_m, bearing_grid(config).max_cells),
            _ => fix.map,
        };
        Ok(Located {
            observations: count,
            border_mass: Some(fix.border_mass),
            regions_95: regions(&map, 0.95),
            common_errors: fix.common.map(in_degrees),
            map: Some(map.clone()),
            ..Located::at(map.about(map.centre(mode)))
        })
    }

    fn uses_receiver_sigma(&self) -> bool {
        true
    }
}

fn in_degrees(common: foxhunt_filters::CommonErrors) -> CommonErrors {
    let station = |own: foxhunt_filters::StationError| {
        let Marginal { mean, sd } = own.error;
        let error_deg_ccw = Marginal { mean: mean.to_degrees(), sd: sd.to_degrees() };
        StationError { place: own.place, bearings: own.bearings, error_deg_ccw }
    };
    let degrees = |(sigma, probability): (f64, f64)| (sigma.to_degrees(), probability);
    CommonErrors {
        sigmas_deg: common.sigmas.into_iter().map(degrees).collect(),
        stations: common.stations.into_iter().map(station).collect(),
    }
}

fn posterior(
    receptions: &Receptions,
    config: &LocateConfig,
) -> Result<(BearingGridFix, usize), LocateError> {
    let weighted: Vec<_> = receptions.iter().filter_map(|r| weighted_line(&r)).collect();
    if weighted.is_empty() {
        return Err(LocateError::NoBearings);
    }
    let fix = bearing_grid(config).locate(&weighted).map_err(LocateError::Bearings)?;
    Ok((fix, weighted.len()))
}

/// The grid of bearings with the settings of `locate`.
pub(super) fn bearing_grid(config: &LocateConfig) -> BearingGrid {
    BearingGrid {
        freedom: config.bearing_freedom,
        margin_m: config.margin_m,
        ..BearingGrid::default()
    }
}

/// σ of bearings, learned from how well the bearings of each of several transmitters meet.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnedSigma {
    /// Factor on the σ that the bearings have.
    pub factor: f64,
    /// Degrees of freedom that the factor is known with.
    pub freedom: f64,
    /// Indices of the transmitters whose bearings meet so badly that they taught nothing.
    pub left_out: Vec<usize>,
}

/// Probability of a misfit at which a transmitter is left out of what all teach.
const ODD_P: f64 = 1e-3;

/// Learns a factor on σ, common to several transmitters, from how well the bearings of each meet:
/// σ belongs to receivers and observers, not to a transmitter. Transmitters that cannot be located
/// teach nothing.
///
/// Bearings that the others of their transmitter contradict teach nothing, nor do transmitters
/// whose bearings do not meet, as with a compass read backwards: the factor begins as the median
/// of the transmitters' own, and is then fitted to all whose misfit is probable under it, until
/// these stay the same.
#[must_use]
pub fn learn_bearing_sigma<'a>(
    transmitters: impl IntoIterator<Item = &'a Receptions>,
    config: &LocateConfig,
) -> LearnedSigma {
    let mut taught: Vec<Taught> = Vec::new();
    for (index, receptions) in transmitters.into_iter().enumerate() {
        // A place takes two of the bearings' degrees of freedom.
        let kept = examination::without_outliers(receptions, config);
        if let Ok((fix, count @ 3..)) = posterior(&kept, config) {
            let degrees = f64::from(u32::try_from(count - 2).unwrap_or(u32::MAX));
            taught.push(Taught { index, misfit: fix.misfit, degrees });
        }
    }
    let mut ratios: Vec<f64> = taught.iter().map(Taught::ratio).collect();
    ratios.sort_by(f64::total_cmp);
    let mut square = ratios.get(ratios.len() / 2).copied().unwrap_or(1.0);
    let odd_p = ODD_P / f64::from(u32::try_from(taught.len().max(1)).unwrap_or(u32::MAX));
    let mut left_out: Vec<usize> = Vec::new();
    let mut freedom = config.bearing_freedom;
    for _ in 0..20 {
        let is_odd = |of: &&Taught| of.p(square) < odd_p;
        let odd: Vec<usize> = taught.iter().filter(is_odd).map(|of| of.index).collect();
        let mut misfit = config.bearing_freedom;
        let mut degrees = config.bearing_freedom;
        for of in taught.iter().filter(|of| !odd.contains(&of.index)) {
            misfit += of.misfit;
            degrees += of.degrees;
        }
        (square, freedom) = (misfit / degrees, degrees);
        if odd == left_out {
            break;
        }
        left_out = odd;
    }
    LearnedSigma { factor: square.sqrt(), freedom, left_out }
}

/// Meeting of the bearings of one transmitter.
struct Taught {
    index: usize,
    misfit: f64,
    degrees: f64,
}

impl Taught {
    /// The misfit over the median of χ² (Wilson & Hilferty 1931).
    fn ratio(&self) -> f64 {
        self.misfit / (self.degrees * (1.0 - 2.0 / (9.0 * self.degrees)).powi(3))
    }

    /// The probability of such a misfit where the mean square of the errors over σ is known.
    fn p(&self, square: f64) -> f64 {
        ChiSquared::new(self.degrees).map_or(1.0, |law| law.sf((self.misfit / square).max(0.0)))
    }
}

/// Meeting point of the bearings by medians (`filters::repeated_median`).
#[derive(Clone, Copy, Debug)]
pub struct RepeatedMedian;

impl Locator for RepeatedMedian {
    fn locate(&self, receptions: &Receptions, _: &LocateConfig) -> Result<Located, LocateError> {
        let lines = lines(receptions)?;
        let fix = repeated_median(&lines).map_err(LocateError::Bearings)?;
        Ok(Located { observations: lines.len(), ..Located::at(fix.position) })
    }
}

/// A closed form over bearings, each with its σ.
type Solve = fn(&[(BearingLine, f64)]) -> Result<Estimate<2>, BatchError>;

/// Meeting point of the bearings, each with its own σ, in closed form.
#[derive(Clone, Copy, Debug)]
pub enum ClosedForm {
    /// Linear least squares, each bearing by the distance of its line.
    Pseudolinear,
    /// Stansfield 1947.
    Stansfield,
    /// Instrumental variables, against the bias of the pseudolinear form.
    InstrumentalVariables,
}

impl Locator for ClosedForm {
    fn locate(&self, receptions: &Receptions, _: &LocateConfig) -> Result<Located, LocateError> {
        let weighted: Vec<_> = receptions.iter().filter_map(|r| weighted_line(&r)).collect();
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
pub(super) fn weighted_line(reception: &Reception) -> Option<(BearingLine, f64)> {
    let own = reception.bearing.map(|bearing| (bearing.angle, bearing.sigma));
    let (bearing, sigma) = reception.modes.moments().or(own)?;
    Some((BearingLine { receiver: reception.receiver.position.xy(), bearing }, sigma))
}

fn lines(receptions: &Receptions) -> Result<Vec<BearingLine>, LocateError> {
    let lines: Vec<_> =
        receptions.iter().filter_map(|r| weighted_line(&r).map(|(line, _)| line)).collect();
    if lines.is_empty() { Err(LocateError::NoBearings) } else { Ok(lines) }
}
