use alloc::{vec, vec::Vec};

use foxhunt_core::Pose;
use nalgebra::Vector2;

use super::{
    Intercept, ShadowingGridConfig, ShadowingGridError,
    grid::{Grid, PosteriorMap},
    marginal::Mixture,
    path::Segments,
    regression::{Products, Regression},
    whitener::{LANES, Row},
};

/// The readings' likelihood of a place, with a and σ integrated out, b and ℓ summed over.
#[derive(Debug)]
pub(super) struct Likelihood {
    receivers: Vec<Pose>,
    /// What was taken from the values before: the known intercept, or their mean for the sake
    /// of rounding.
    offset: f64,
    intercept_is_flat: bool,
    /// One per correlation length.
    regressions: Vec<Regression>,
    /// The slopes and their log-weights.
    slopes: Vec<(f64, f64)>,
    /// n − 1 degrees of freedom, n if the intercept is known.
    freedom: f64,
    /// E σ / √SSR.
    sigma_ratio: f64,
}

/// The posterior on one grid.
#[derive(Clone, Debug)]
pub(super) struct Posterior {
    pub(super) map: PosteriorMap,
    pub(super) intercept: Mixture,
    pub(super) slope: Mixture,
    pub(super) sigma: Mixture,
    /// The probability of each correlation length.
    pub(super) lengths: Vec<f64>,
}

/// What one cell and one correlation length give: the log-mass, not normalised, and means and
/// variances given the cell.
#[derive(Clone, Copy, Debug)]
struct Conditional {
    log_mass: f64,
    intercept: (f64, f64),
    slope: (f64, f64),
    sigma: (f64, f64),
}

impl Likelihood {
    /// Factors the correlation for each length.
    pub(super) fn new(
        config: &ShadowingGridConfig,
        segments: Segments,
    ) -> Result<Self, ShadowingGridError> {
        let Segments { receivers, mut values, .. } = segments;
        #[expect(clippy::cast_precision_loss, reason = "capped by a u32")]
        let n = values.len() as f64;
        let (intercept_is_flat, offset) = match config.intercept {
            Intercept::Flat => (true, values.iter().sum::<f64>() / n),
            Intercept::Known(value) => (false, value),
        };
        for value in &mut values {
            *value -= offset;
        }
        let regression = |&length_m: &f64| {
            Regression::new(&receivers, &values, intercept_is_flat, length_m, config.nugget)
                .ok_or(ShadowingGridError::Correlation { length_m })
        };
        let regressions =
            config.correlation_lengths_m.iter().map(regression).collect::<Result<_, _>>()?;
        let freedom = if intercept_is_flat { n - 1.0 } else { n };
        let ratio = libm::lgamma(0.5 * (freedom - 1.0)) - libm::lgamma(0.5 * freedom);
        let sigma_ratio = libm::exp(ratio) * core::f64::consts::FRAC_1_SQRT_2;
        let slopes = config.slope.log_nodes();
        Ok(Self { receivers, offset, intercept_is_flat, regressions, slopes, freedom, sigma_ratio })
    }

    /// Where the readings came from, after thinning.
    pub(super) fn receivers(&self) -> &[Pose] {
        &self.receivers
    }

    /// The posterior over a grid whose cells are equally likely before.
    pub(super) fn posterior<F>(
        &self,
        grid: Grid,
        regressor: &F,
    ) -> Result<Posterior, ShadowingGridError>
    where
        F: Fn(&Vector2<f64>, &Pose) -> f64,
    {
        let cells = self.conditionals(&grid, regressor);
        let peak = cells.iter().map(|c| c.log_mass).fold(f64::NEG_INFINITY, f64::max);
        if !peak.is_finite() {
            return Err(ShadowingGridError::Posterior { cells: grid.len() });
        }
        let mut mass = vec![0.0; grid.len()];
        let mut lengths = vec![0.0; self.regressions.len()];
        let (mut intercept, mut slope, mut sigma) = <(Mixture, Mixture, Mixture)>::default();
        for (mass, cells) in mass.iter_mut().zip(cells.chunks(self.regressions.len())) {
            for (cell, length) in cells.iter().zip(&mut lengths) {
                let weight = libm::exp(cell.log_mass - peak);
                *mass += weight;
                *length += weight;
                intercept.add(weight, cell.intercept.0, cell.intercept.1);
                slope.add(weight, cell.slope.0, cell.slope.1);
                sigma.add(weight, cell.sigma.0, cell.sigma.1);
            }
        }
        let total: f64 = lengths.iter().sum();
        for share in mass.iter_mut().chain(&mut lengths) {
            *share /= total;
        }
        Ok(Posterior { map: PosteriorMap::new(grid, mass), intercept, slope, sigma, lengths })
    }

    /// Every cell under every correlation length, the lengths of a cell side by side.
    fn conditionals<F>(&self, grid: &Grid, regressor: &F) -> Vec<Conditional>
    where
        F: Fn(&Vector2<f64>, &Pose) -> f64,
    {
        let mut conditionals = Vec::with_capacity(grid.len() * self.regressions.len());
        let mut x: Vec<Row> = vec![[0.0; LANES]; self.receivers.len()];
        let mut white = x.clone();
        for begin in (0..grid.len()).step_by(LANES) {
            // Past the last cell the lanes repeat it; their results are not read.
            let lanes = LANES.min(grid.len() - begin);
            let places: [_; LANES] =
                core::array::from_fn(|k| grid.centre(begin + k.min(lanes - 1)));
            for (row, receiver) in x.iter_mut().zip(&self.receivers) {
                *row = core::array::from_fn(|k| regressor(&places[k], receiver));
            }
            // A constant in x is the intercept's: taking it out first saves digits.
            let mut origin = [0.0; LANES];
            if let Some(first) = x.first().filter(|_| self.intercept_is_flat) {
                origin = *first;
            }
            for row in &mut x {
                *row = core::array::from_fn(|k| row[k] - origin[k]);
            }
            let blocks: Vec<[Products; LANES]> = (self.regressions.iter())
                .map(|regression| {
                    white.copy_from_slice(&x);
                    regression.products(&mut white)
                })
                .collect();
            for k in 0..lanes {
                let lengths = self.regressions.iter().zip(&blocks);
                conditionals
                    .extend(lengths.map(|(r, block)| self.conditional(r, &block[k], origin[k])));
            }
        }
        conditionals
    }

    /// ln p(values | cell, ℓ) up to a constant: Σ_b w_b |C|^−½ (u·u)^−½ SSR(b)^(−ν/2)
    /// (Handcock & Stein 1993), and the moments of a, b, σ that go with it.
    fn conditional(&self, regression: &Regression, x: &Products, origin: f64) -> Conditional {
        let log_mass = |&(b, log_weight): &(f64, f64)| {
            let residual_square = regression.residual_square(x, b);
            let log_mass = log_weight - 0.5 * self.freedom * libm::log(residual_square);
            (b, residual_square, if log_mass.is_nan() { f64::NEG_INFINITY } else { log_mass })
        };
        let peak = self.slopes.iter().map(log_mass).fold(f64::NEG_INFINITY, |m, n| m.max(n.2));
        let (mut intercept, mut slope, mut sigma) = <(Mixture, Mixture, Mixture)>::default();
        let mut total = 0.0;
        for (b, residual_square, log_mass) in self.slopes.iter().map(log_mass) {
            let weight = if peak.is_finite() { libm::exp(log_mass - peak) } else { 0.0 };
            total += weight;
            slope.add(weight, b, 0.0);
            // σ² is inverse gamma, of shape ν/2 and scale SSR/2; a is Student's t about â.
            let square = residual_square / (self.freedom - 2.0);
            let mean = self.sigma_ratio * libm::sqrt(residual_square);
            sigma.add(weight, mean, square - mean * mean);
            let variance =
                if self.intercept_is_flat { square / regression.ones_square() } else { 0.0 };
            let best = self.offset + regression.intercept(x, b) - b * origin;
            intercept.add(weight, best, variance);
        }
        Conditional {
            log_mass: regression.log_scale() + peak + libm::log(total),
            intercept: (intercept.mean(), intercept.variance()),
            slope: (slope.mean(), slope.variance()),
            sigma: (sigma.mean(), sigma.variance()),
        }
    }
}
