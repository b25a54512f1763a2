use foxhunt_core::{Pose, Reception, ReceptionView, Receptions};
use foxhunt_filters::{Intercept, ShadowingGrid, ShadowingGridConfig, Slope};
use nalgebra::Vector2;

#[cfg(feature = "batch")]
use super::bearings::{bearing_grid, weighted_line};
use super::{
    CalibratedPower, Explanation, LocateConfig, LocateError, Located, Locator, Power,
    area::extent_m,
    config::{Centroid, Height},
    located::{levels_and_silences, receiver_sigma_m},
    loss_and_dipole,
    path::is_of_network,
    region::regions,
};

/// All levels at once on a grid, with shadowing that is correlated along the flight and antennas
/// whose gain falls with the elevation (`filters::ShadowingGrid`): P₀ and γ are the intercept and
/// the slope over −10 log₁₀ of the range, the gain's regressor is that of a vertical dipole, or the
/// known one of the antennas on the way. Bearings, where there are any, weigh in by the likelihood
/// of `filters::BearingGrid`, and need no power of the transmitter.
#[derive(Clone, Copy, Debug)]
pub struct CorrelatedShadowing;

/// Number of readings that a calibration's σ counts for at most: σ differs from flight to flight
/// by a third (4.5 to 8.1 dB over one site), as that of a sample of eight does.
const MOST_READINGS_OF_SIGMA: f64 = 8.0;

/// Variance of a calibrated level over that of readings, below which digits are lost.
const LEAST_VARIANCE: f64 = 1e-9;

/// σ in dB below which a calibration's levels are rounding.
const LEAST_SIGMA_DB: f64 = 0.1;

/// Nodes of γ on one side of its mean, and σ from one to the next.
const NODES: (f64, f64) = (4.0, 0.6);

/// Heights that a transmitter may have in metres, each with its weight: on the ground, an animal or
/// a person; on a car or a mast; on a house or in a tree; on a tower.
const HEIGHTS: [(f64, f64); 5] =
    [(1.0, 0.45), (6.0, 0.25), (15.0, 0.15), (35.0, 0.1), (70.0, 0.05)];

/// Height in metres that a transmitter may have wherever the receivers are.
const LEAST_MOST_M: f64 = 6.0;

/// Returns the prior of the transmitter's height: below the highest receiver, or near the ground.
fn heights(receptions: &Receptions) -> Slope {
    let ups = receptions.places().map(|place| place.z);
    let most = ups.fold(LEAST_MOST_M, f64::max);
    let below = HEIGHTS.iter().filter(|(height, _)| *height <= most);
    Slope::Nodes(below.copied().collect())
}

/// Returns the priors of P₀ and γ that a calibration leaves.
fn prior_of(calibrated: &CalibratedPower) -> Result<(Intercept, Slope), LocateError> {
    let Centroid { loss, level_dbm, variance, exponent, exponent_sigma } = calibrated.centroid();
    let sigma_db = calibrated.sigma_db.max(LEAST_SIGMA_DB);
    let variance = (variance / (sigma_db * sigma_db)).max(LEAST_VARIANCE);
    let intercept = Intercept::Calibrated { regressor: loss, value: level_dbm, variance };
    if exponent_sigma <= 0.0 {
        return Ok((intercept, Slope::Known(exponent)));
    }
    let (nodes, step) = NODES;
    let reach = nodes * step * exponent_sigma;
    let lower = (exponent - reach).max(0.1 * exponent);
    let step = step * exponent_sigma;
    let slope = Slope::gaussian(exponent, exponent_sigma, lower, exponent + reach, step)?;
    Ok((intercept, slope))
}

impl Locator for CorrelatedShadowing {
    fn locate(
        &self,
        receptions: &Receptions,
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let readings = levels_and_silences(receptions)?;
        let observations = receptions.views().filter(|r| r.any_level_dbm().is_some()).count();
        let extent_m = extent_m(receptions);
        // Who looks for a direction may stand far away.
        let looks = receptions.kinds().iter().any(Reception::has_bearing);
        let defaults = if !looks && is_of_network(receptions, extent_m) {
            ShadowingGridConfig::of_network(extent_m)
        } else {
            ShadowingGridConfig::over(extent_m)
        };
        let receiver_sigma_m = receiver_sigma_m(receptions);
        let (intercept, slope) = match config.power {
            Power::Free => (Intercept::Flat, defaults.slope.clone()),
            Power::FreeReference { exponent } => (Intercept::Flat, Slope::Known(exponent)),
            Power::Known { reference_dbm, exponent } => {
                (Intercept::Known(reference_dbm), Slope::Known(exponent))
            }
            Power::Calibrated(calibrated) => prior_of(&calibrated)?,
        };
        let sigma_prior = match config.power {
            Power::Calibrated(CalibratedPower { sigma_db, points, .. }) => {
                let points = u32::try_from(points).map_or(f64::INFINITY, f64::from);
                ((points - 2.0).clamp(1.0, MOST_READINGS_OF_SIGMA), sigma_db)
            }
            _ => defaults.sigma_prior,
        };
        let gain = if config.pattern.is_some() { Slope::Known(1.0) } else { defaults.gain.clone() };
        let up = config.target_up_m;
        let is_free = config.height == Height::Free;
        let grid = ShadowingGrid::new(ShadowingGridConfig {
            intercept,
            slope,
            gain,
            height: if is_free { heights(receptions) } else { Slope::Known(up) },
            margin_m: config.margin_m.min(defaults.margin_m),
            receiver_sigma_m,
            sigma_prior,
            ..defaults
        })?;
        let own_square = receiver_sigma_m * receiver_sigma_m;
        let regressors = |cell: &Vector2<f64>, receiver: &Pose, up: f64| {
            let way = cell.push(up) - receiver.position;
            let [loss, dipole] = loss_and_dipole(&way, own_square);
            let Some(pattern) = &config.pattern else { return [loss, dipole] };
            let sight = receiver.to_body(&way);
            [loss, pattern.gain_db(libm::atan2(sight.z, sight.xy().norm()))]
        };
        #[cfg(feature = "batch")]
        let fix = {
            let views = receptions.views().enumerate();
            let directed = views.filter(|(_, view)| view.kind.has_bearing());
            let directed = directed.filter_map(|(index, _)| receptions.get(index));
            let lines: Vec<_> = directed.clone().filter_map(|r| weighted_line(&r)).collect();
            let bearings = bearing_grid(config).log_likelihood(&lines);
            let bearings = bearings.map_err(LocateError::Bearings)?;
            let others: Vec<Pose> = directed.map(|reception| reception.receiver).collect();
            grid.locate_with(readings, regressors, &others, bearings)?
        };
        #[cfg(not(feature = "batch"))]
        let fix = grid.locate_with(readings, regressors, &[], |_| 0.0)?;
        let with_level: Vec<usize> = if fix.left_out.is_empty() {
            Vec::new()
        } else {
            let has_level =
                |(index, view): (usize, ReceptionView<'_>)| view.any_level_dbm().map(|_| index);
            receptions.views().enumerate().filter_map(has_level).collect()
        };
        let left_out = fix.left_out.iter().filter_map(|index| with_level.get(*index).copied());
        let levels_left_out: Vec<usize> = left_out.collect();
        let map = fix.finest();
        let estimate = map.about(map.median());
        Ok(Located {
            observations: observations - levels_left_out.len(),
            rejected: levels_left_out.len(),
            levels_left_out,
            border_mass: Some(fix.border_mass),
            regions_95: regions(map, 0.95),
            map: Some(map.clone()),
            explanation: Some(Explanation {
                exponent: fix.slope,
                dipoles: config.pattern.is_none().then_some(fix.gain),
                target_up_m: is_free.then_some(fix.height),
                sigma_db: fix.sigma,
                correlation_lengths_m: fix.correlation_lengths_m.clone(),
                own_shares: fix.nuggets.clone(),
            }),
            ..Located::at(estimate)
        })
    }
    fn estimates_height(&self) -> bool {
        true
    }

    fn uses_antennas(&self) -> bool {
        true
    }

    fn uses_receiver_sigma(&self) -> bool {
        true
    }
}
