use alloc::{vec, vec::Vec};

use foxhunt_core::Pose;
use nalgebra::Vector2;

use super::{
    Intercept, LANES, Marginal, Mixture, Moments, Row, ShadowingGridConfig, ShadowingGridError,
    censored::{Censored, Law, NEGLIGIBLE, Scaled},
    coefficient::{Coefficient, Width},
    explanations::{Explanations, Sums},
    grid::{Grid, PosteriorMap},
    path::Segments,
    regression::{Products, Regression},
};
use crate::vecchia::{Correlation, Neighbours, Receivers};

/// Gap in the log-likelihood below the best at a sample of cells beyond which a correlation is
/// left out of all cells.
const IMPROBABLE: f64 = 9.0;

/// Difference of the gain's regressor over the receivers that counts as zero, in its unit.
const SAME_GAIN: f64 = 1e-6;

/// Degrees of freedom from which a coefficient's Student's t is as good as Gaussian: of 20, 10⁻³
/// lie beyond its nodes.
const GAUSSIAN: f64 = 20.0;

/// Square of the distance between the priors and the likelihood in their σ, by degrees of freedom,
/// up to which what both tell has one peak: farther apart, the wide flanks of Student's t leave one
/// at the prior's.
const AGREED: f64 = 0.75;

/// Number of blocks of cells by which correlations are judged.
const SAMPLED_BLOCKS: usize = 8;

/// The readings' likelihood of a place, with a and σ integrated out and all else summed over.
#[derive(Debug)]
pub(super) struct Likelihood {
    receivers: Vec<Pose>,
    /// Level taken from the values before: the known intercept, or their mean for the sake of
    /// rounding.
    offset: f64,
    /// True if the intercept is estimated, also where a calibration tells of it.
    intercept_is_flat: bool,
    /// Regressors of the calibration, which is the last reading.
    calibration: Option<[f64; 2]>,
    /// One per correlation length and nugget, the nuggets of a length side by side.
    regressions: Vec<Regression>,
    slope: Coefficient,
    gain: Coefficient,
    /// Degrees of freedom: n − 1, or n if the intercept is known, plus the prior's of σ.
    freedom: f64,
    /// SSR before any reading, by the prior of σ.
    prior_square: f64,
    /// E σ / √SSR.
    sigma_ratio: f64,
    censored: Censored,
}

/// The posterior on one grid.
#[derive(Clone, Debug)]
pub(super) struct Posterior {
    pub map: PosteriorMap,
    pub intercept: Mixture,
    pub slope: Mixture,
    pub gain: Mixture,
    pub sigma: Mixture,
    pub shares: Shares,
}

/// The probability of each height and correlation.
#[derive(Clone, Debug)]
pub(super) struct Shares {
    pub heights: Vec<f64>,
    pub correlations: Vec<f64>,
}

impl Shares {
    fn each(&mut self) -> impl Iterator<Item = &mut f64> {
        self.heights.iter_mut().chain(&mut self.correlations)
    }

    /// Adds the shares of a part of all probability.
    fn add(&mut self, weight: f64, part: &mut Self) {
        for (sum, share) in self.each().zip(part.each()) {
            *sum += weight * *share;
        }
    }
}

/// Result for one cell: the log-mass, not normalised, and all else given the cell.
#[derive(Clone, Debug)]
struct Conditional {
    log_mass: f64,
    intercept: Mixture,
    slope: Marginal,
    gain: Marginal,
    sigma: Mixture,
    shares: Shares,
}

impl Likelihood {
    /// Factors each correlation.
    pub(super) fn new(
        config: &ShadowingGridConfig,
        segments: Segments,
    ) -> Result<Self, ShadowingGridError> {
        let Segments { receivers, mut values, counts, mut censored, .. } = segments;
        #[expect(clippy::cast_precision_loss, reason = "capped by a u32")]
        let mut n = values.len() as f64;
        let (intercept_is_flat, offset) = match config.intercept {
            Intercept::Flat | Intercept::Calibrated { .. } => {
                (true, values.iter().sum::<f64>() / n)
            }
            Intercept::Known(value) => (false, value),
        };
        let mut calibration = None;
        let mut calibration_variance = None;
        if let Intercept::Calibrated { regressor, value, variance } = config.intercept {
            values.push(value);
            n += 1.0;
            calibration = Some([regressor, 0.0]);
            calibration_variance = Some(variance);
        }
        for value in values.iter_mut().chain(censored.iter_mut().map(|(limit, _)| &mut limit.value))
        {
            *value -= offset;
        }
        let of_length = |&length_m: &f64| {
            config.nuggets.iter().map(move |&nugget| Correlation { length_m, nugget })
        };
        let correlations: Vec<Correlation> =
            config.correlation_lengths_m.iter().flat_map(of_length).collect();
        let received = Receivers { poses: &receivers, counts: &counts };
        // Without their calibration, which no segment is a neighbour of.
        let near = (received, &Neighbours::new(&receivers));
        let regression = |correlation: &Correlation| {
            let Correlation { length_m, .. } = *correlation;
            Regression::new(near, &values, calibration_variance, intercept_is_flat, *correlation)
                .ok_or(ShadowingGridError::Correlation { length_m })
        };
        let regressions: Vec<Regression> =
            correlations.iter().map(regression).collect::<Result<_, _>>()?;
        let of_intercept = |regression: &Regression| {
            if intercept_is_flat { 1.0 / regression.ones_square() } else { 0.0 }
        };
        let correlated = correlations.iter().copied().zip(regressions.iter().map(of_intercept));
        let censored = Censored::new(&censored, received, &values, correlated);
        let (prior_readings, prior_sigma) = config.sigma_prior;
        let freedom = prior_readings + if intercept_is_flat { n - 1.0 } else { n };
        // With fewer degrees of freedom σ has no mean.
        let half = 0.5 * freedom.max(2.0);
        let ratio = libm::lgamma(half - 0.5) - libm::lgamma(half);
        let sigma_ratio = libm::exp(ratio) * core::f64::consts::FRAC_1_SQRT_2;
        Ok(Self {
            receivers,
            offset,
            intercept_is_flat,
            calibration,
            regressions,
            slope: Coefficient::new(&config.slope),
            gain: Coefficient::new(&config.gain),
            freedom,
            prior_square: prior_readings * prior_sigma * prior_sigma,
            sigma_ratio,
            censored,
        })
    }

    /// Returns the mean of σ², which is inverse gamma, for a sum of squares. It has none for two
    /// degrees of freedom or fewer: the sum stands for it, or four times the sum for fewer, of a
    /// single segment with a value. With less, regions of drawn networks are too small.
    fn mean_variance(&self, square: f64) -> f64 {
        let divisor = if self.freedom < 2.0 { 0.25 } else { (self.freedom - 2.0).max(1.0) };
        square / divisor
    }

    /// Returns the number of segments with a value.
    pub(super) fn segments(&self) -> usize {
        self.receivers.len()
    }

    /// The posterior over a grid, from the target's heights with their log-weights, −∞ for
    /// heights that are ruled out, and the log-density of places before the readings.
    pub(super) fn posterior(
        &self,
        grid: Grid,
        heights: &[(f64, f64)],
        regressors: &impl Fn(&Vector2<f64>, &Pose, f64) -> [f64; 2],
        log_prior: &impl Fn(&Vector2<f64>) -> f64,
    ) -> Result<Posterior, ShadowingGridError> {
        let mut layers = Vec::with_capacity(heights.len());
        for (number, &(height, log_weight)) in heights.iter().enumerate() {
            if log_weight <= f64::NEG_INFINITY {
                continue;
            }
            let at = |place: &Vector2<f64>, receiver: &Pose| regressors(place, receiver, height);
            let mut cells = self.layer(&grid, &at, log_prior);
            for cell in &mut cells {
                cell.log_mass += log_weight;
                cell.shares.heights = vec![0.0; heights.len()];
                if let Some(share) = cell.shares.heights.get_mut(number) {
                    *share = 1.0;
                }
            }
            layers.push(cells);
        }
        let log_masses = layers.iter().flatten().map(|cell| cell.log_mass);
        let peak = log_masses.fold(f64::NEG_INFINITY, f64::max);
        if !peak.is_finite() {
            return Err(ShadowingGridError::Posterior { cells: grid.len() });
        }
        let mass_of = |cell: &Conditional| libm::exp(cell.log_mass - peak);
        let total: f64 = layers.iter().flatten().map(mass_of).sum();
        let mut mass = vec![0.0; grid.len()];
        let mut shares = self.no_shares();
        shares.heights = vec![0.0; heights.len()];
        let [mut intercept, mut slope, mut gain, mut sigma] = [Mixture::default(); 4];
        for cells in &mut layers {
            for (sum, cell) in mass.iter_mut().zip(cells) {
                let own = mass_of(cell) / total;
                if own > 0.0 {
                    *sum += own;
                    shares.add(own, &mut cell.shares);
                    intercept.add(own, cell.intercept.mean(), cell.intercept.variance());
                    slope.add(own, cell.slope.mean, cell.slope.sd * cell.slope.sd);
                    gain.add(own, cell.gain.mean, cell.gain.sd * cell.gain.sd);
                    sigma.add(own, cell.sigma.mean(), cell.sigma.variance());
                }
            }
        }
        let map = PosteriorMap::of_densities(grid, mass, peak + libm::log(total));
        Ok(Posterior { map, intercept, slope, gain, sigma, shares })
    }

    /// The cells at one height of the target.
    fn layer(
        &self,
        grid: &Grid,
        regressors: &impl Fn(&Vector2<f64>, &Pose) -> [f64; 2],
        log_prior: &impl Fn(&Vector2<f64>) -> f64,
    ) -> Vec<Conditional> {
        // Readings without a word on the gain leave its prior.
        let held = (!self.gain_matters(grid, regressors)).then(|| self.gain.held());
        let gain = held.as_ref().unwrap_or(&self.gain);
        let sampled = self.probable(grid, gain, regressors, log_prior);
        let mut cells = self.conditionals(grid, 1, &sampled, gain, regressors, log_prior);
        if held.is_some() {
            let prior = self.gain.prior();
            cells.iter_mut().for_each(|cell| cell.gain = prior);
        }
        cells
    }

    fn no_shares(&self) -> Shares {
        Shares { heights: Vec::new(), correlations: vec![0.0; self.regressions.len()] }
    }

    /// Returns true unless the gain's regressor is the same for all receivers, as at the target's
    /// own height: the intercept takes it up.
    fn gain_matters(
        &self,
        grid: &Grid,
        regressors: &impl Fn(&Vector2<f64>, &Pose) -> [f64; 2],
    ) -> bool {
        let stride = grid.len().div_ceil(LANES).max(1);
        let matters = (0..grid.len()).step_by(stride).any(|index| {
            let place = grid.centre(index);
            let mut gains = self.receivers.iter().map(|receiver| regressors(&place, receiver)[1]);
            let first = gains.next().unwrap_or(0.0);
            gains.any(|gain| (gain - first).abs() > SAME_GAIN)
        });
        matters || !self.intercept_is_flat || self.calibration.is_some()
    }

    /// The correlations that matter, and the largest log-mass, by a sample of the cells.
    fn probable(
        &self,
        grid: &Grid,
        gain: &Coefficient,
        regressors: &impl Fn(&Vector2<f64>, &Pose) -> [f64; 2],
        log_prior: &impl Fn(&Vector2<f64>) -> f64,
    ) -> Sampled {
        let correlations = (0..self.regressions.len()).collect();
        let all = Sampled { correlations, best: f64::NEG_INFINITY };
        let stride = grid.len() / (SAMPLED_BLOCKS * LANES);
        if stride < 2 || (all.correlations.len() < 2 && self.censored.is_empty()) {
            return all;
        }
        let sample = self.conditionals(grid, stride, &all, gain, regressors, log_prior);
        let mut best = vec![f64::NEG_INFINITY; self.regressions.len()];
        for cell in &sample {
            for (best, share) in best.iter_mut().zip(&cell.shares.correlations) {
                *best = best.max(cell.log_mass + libm::log(*share));
            }
        }
        let peak = best.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if !peak.is_finite() {
            return all;
        }
        let matters = best.iter().enumerate().filter(|(_, best)| **best - peak > -IMPROBABLE);
        let correlations = matters.map(|(correlation, _)| correlation).collect();
        Sampled { correlations, best: peak }
    }

    /// Some correlations, each with its number.
    fn explained_by(
        &self,
        correlations: &[usize],
    ) -> impl Iterator<Item = (usize, &Regression)> + Clone {
        correlations.iter().filter_map(|number| Some((*number, self.regressions.get(*number)?)))
    }

    /// One cell in `stride`, given that the target is there, under the sampled correlations; its
    /// mass is with the prior.
    fn conditionals(
        &self,
        grid: &Grid,
        stride: usize,
        sampled: &Sampled,
        gain: &Coefficient,
        regressors: &impl Fn(&Vector2<f64>, &Pose) -> [f64; 2],
        log_prior: &impl Fn(&Vector2<f64>) -> f64,
    ) -> Vec<Conditional> {
        let mut conditionals = Vec::with_capacity(grid.len());
        let has_gain = gain.len() > 1 || gain.first() != 0.0;
        let readings = self.receivers.len() + usize::from(self.calibration.is_some());
        let mut x: Vec<Row> = vec![[0.0; LANES]; readings];
        let mut g = if has_gain { x.clone() } else { Vec::new() };
        let mut white_x = x.clone();
        let mut white_g = g.clone();
        let mut scratch = Scratch::default();
        // Regressors of the receivers with a value and without, and the latter's beyond what their
        // neighbours tell, one correlation after another.
        let mut received: Vec<[Row; 2]> = Vec::new();
        let mut silent: Vec<[Row; 2]> = Vec::new();
        let mut beyond: Vec<[Row; 2]> = Vec::new();
        let probable = &sampled.correlations;
        let mut best = sampled.best;
        let count = grid.len().div_ceil(stride);
        for begin in (0..count).step_by(LANES) {
            // Past the last cell the lanes repeat it; their results are not read.
            let lanes = LANES.min(count - begin);
            let places: [_; LANES] =
                core::array::from_fn(|k| grid.centre((begin + k.min(lanes - 1)) * stride));
            let both = |receiver: &Pose| -> [Row; 2] {
                let both: [_; LANES] = core::array::from_fn(|k| regressors(&places[k], receiver));
                [both.map(|[slope, _]| slope), both.map(|[_, gain]| gain)]
            };
            received.clear();
            for (i, receiver) in self.receivers.iter().enumerate() {
                let [slope, gain] = both(receiver);
                x[i] = slope;
                if let Some(row) = g.get_mut(i) {
                    *row = gain;
                }
                if !self.censored.is_empty() {
                    received.push([slope, gain]);
                }
            }
            if let Some([slope, gain]) = self.calibration {
                // The last rows are the calibration's; without a gain there is no row of it.
                x.last_mut().into_iter().for_each(|row| *row = [slope; LANES]);
                g.last_mut().into_iter().for_each(|row| *row = [gain; LANES]);
            }
            let origins = [self.without_origin(&mut x), self.without_origin(&mut g)];
            let blocks: Vec<[Products; LANES]> = (self.explained_by(probable))
                .map(|(_, regression)| {
                    white_x.copy_from_slice(&x);
                    white_g.copy_from_slice(&g);
                    regression.products(&mut white_x, &mut white_g)
                })
                .collect();
            silent.clear();
            silent.extend(self.censored.receivers().iter().map(both));
            beyond.clear();
            for number in probable {
                self.censored.beyond_neighbours(*number, &silent, &received, &mut beyond);
            }
            let of_silent = beyond.chunks(silent.len().max(1)).chain(core::iter::repeat(&[][..]));
            for column in 0..lanes {
                let explained = self.explained_by(probable).zip(&blocks).zip(of_silent.clone());
                let explained = explained.map(|(((number, regression), block), beyond)| Under {
                    number,
                    regression,
                    products: &block[column],
                    beyond,
                    column,
                });
                let origin = origins.map(|row| row[column]);
                let prior = log_prior(&places[column]);
                let needed = best - prior - NEGLIGIBLE;
                let mut cell = self.conditional(explained, origin, gain, needed, &mut scratch);
                cell.log_mass += prior;
                best = best.max(cell.log_mass);
                conditionals.push(cell);
            }
        }
        conditionals
    }

    /// Takes one row from all: a constant in a regressor is the intercept's, and taking it
    /// out first saves digits.
    fn without_origin(&self, rows: &mut [Row]) -> Row {
        // A calibration's row, which may be known far better than all others, is 0 without it.
        let origin = if self.calibration.is_some() { rows.last() } else { rows.first() };
        let origin = origin.copied().filter(|_| self.intercept_is_flat);
        let origin = origin.unwrap_or([0.0; LANES]);
        for row in rows {
            *row = core::array::from_fn(|k| row[k] - origin[k]);
        }
        origin
    }

    /// The best intercept in the readings' unit, where a row of regressors was taken out first.
    fn intercept(
        &self,
        regression: &Regression,
        products: &Products,
        [b, c]: [f64; 2],
        origin: [f64; 2],
    ) -> f64 {
        self.offset + regression.intercept(products, b, c) - b * origin[0] - c * origin[1]
    }

    /// ln p(values | cell) up to a constant: Σ w_b w_c |C|^−½ (u·u)^−½ SSR(b, c)^(−ν/2) over the
    /// slopes, the gains and the correlations (Handcock & Stein 1993), and what goes with it. With
    /// censored segments an explanation less probable than `needed` counts as impossible.
    fn conditional<'a>(
        &self,
        explained: impl Iterator<Item = Under<'a>> + Clone,
        origin: [f64; 2],
        gain: &Coefficient,
        needed: f64,
        scratch: &mut Scratch,
    ) -> Conditional {
        let Scratch { explanations, gains, slopes, scaled } = scratch;
        explanations.clear();
        let references = [self.slope.first(), gain.first()];
        for Under { regression, products, .. } in explained.clone() {
            let square_of = |b, c| self.prior_square + regression.residual_square(products, b, c);
            let (believed, width) = self.believed(gain, regression, products);
            let both = (products, &believed, width);
            for &(c, c_weight) in self.gains(gain, regression, both, gains) {
                let (mean, variance) = regression.slope_for_gain(&believed, c);
                let of_slope = square_of(self.slope.clamped(mean), c) / self.freedom * variance;
                let of_slope = Marginal { mean, sd: libm::sqrt(of_slope) };
                let nodes = self.slope.around(of_slope, width, slopes);
                let log_weight = regression.log_scale() + c_weight;
                explanations.extend(nodes, references, c, log_weight, |b| square_of(b, c));
            }
            explanations.end();
        }
        let mut peak = explanations.set_log_masses(0.5 * self.freedom);
        if !self.censored.is_empty() {
            let beside = (origin, references, needed);
            peak = self.add_censored(explained.clone(), beside, explanations, scaled);
        }
        let mut given = Conditional {
            log_mass: f64::NEG_INFINITY,
            intercept: Mixture::default(),
            slope: Marginal::default(),
            gain: Marginal::default(),
            sigma: Mixture::default(),
            shares: self.no_shares(),
        };
        if !peak.is_finite() {
            return given;
        }
        explanations.set_weights(peak);
        let mut total = 0.0;
        let mut slope = Moments::about(references[0]);
        let mut of_gain = Moments::about(references[1]);
        for (part, Under { number, regression, products, .. }) in explained.enumerate() {
            let Sums { weight, slope: by_slope, gain: by_gain, cross, root, square } =
                explanations.sums(part);
            if weight <= 0.0 {
                continue;
            }
            total += weight;
            if let Some(share) = given.shares.correlations.get_mut(number) {
                *share = weight;
            }
            slope.add_sums(weight, by_slope);
            of_gain.add_sums(weight, by_gain);
            // σ² is inverse gamma, of shape ν/2 and scale SSR/2; a is Student's t about â.
            let variance = self.mean_variance(square / weight);
            let mean = self.sigma_ratio * root / weight;
            given.sigma.add(weight, mean, (variance - mean * mean).max(0.0));
            // â falls by so much with each coefficient.
            let [of_ones, of_origin] = [regression.intercept_slopes(products), origin];
            let [b_slope, c_slope] = [of_ones[0] + of_origin[0], of_ones[1] + of_origin[1]];
            let [b_mean, c_mean] = [by_slope[0] / weight, by_gain[0] / weight];
            let b_variance = by_slope[1] / weight - b_mean * b_mean;
            let c_variance = by_gain[1] / weight - c_mean * c_mean;
            let covariance = cross / weight - b_mean * c_mean;
            let between = b_slope * b_slope * b_variance
                + 2.0 * b_slope * c_slope * covariance
                + c_slope * c_slope * c_variance;
            let per_one = 1.0 / regression.ones_square();
            let of_intercept = if self.intercept_is_flat { variance * per_one } else { 0.0 };
            let means = [references[0] + b_mean, references[1] + c_mean];
            let best = self.intercept(regression, products, means, origin);
            given.intercept.add(weight, best, between.max(0.0) + of_intercept);
        }
        given.log_mass = peak + libm::log(total);
        given.slope = slope.marginal();
        given.gain = of_gain.marginal();
        given.shares.each().for_each(|share| *share /= total);
        given
    }

    /// Adds the log-probability of the censored segments to each explanation: −∞ if it makes
    /// the explanation less probable than `needed`. Returns the largest log-mass.
    fn add_censored<'a>(
        &self,
        explained: impl Iterator<Item = Under<'a>>,
        (origin, references, needed): ([f64; 2], [f64; 2], f64),
        explanations: &mut Explanations,
        scaled: &mut Scaled,
    ) -> f64 {
        let mut peak = f64::NEG_INFINITY;
        for (part, Under { number, regression, products, beyond, column }) in explained.enumerate()
        {
            let laws = explanations.part_mut(part).map(|(b, c, square, log_mass)| {
                let [b, c] = [references[0] + b, references[1] + c];
                let law = Law {
                    // The segments' values are known but for the offset.
                    intercept: self.intercept(regression, products, [b, c], origin) - self.offset,
                    coefficients: [b, c],
                    variance: self.mean_variance(square),
                };
                (law, log_mass)
            });
            peak = self.censored.add_to(number, beyond, column, laws, (needed, peak), scaled);
        }
        peak
    }

    /// The products with the coefficients' priors as readings, where what is known of the
    /// coefficients is nearly Gaussian then, or the readings' alone: silences, too, tell of them.
    /// At a limit of one coefficient the other one's best value is approximate.
    fn believed(
        &self,
        gain: &Coefficient,
        regression: &Regression,
        products: &Products,
    ) -> (Products, Width) {
        if !self.censored.is_empty() {
            return (*products, Width::Likelihood);
        }
        let square_at = |believed: &Products| {
            let [(b, _), (c, _)] = regression.best(believed);
            let [b, c] = [self.slope.clamped(b), gain.clamped(c)];
            let square = self.prior_square + regression.residual_square(products, b, c);
            (square, self.slope.tension(b) + gain.tension(c))
        };
        let (least, _) = square_at(products);
        let priors = [self.slope.gaussian(), gain.gaussian()];
        let with = |square| products.with_priors(priors, square / self.freedom);
        // Residuals are larger at the best coefficients with the priors than without.
        let believed = with(square_at(&with(least)).0);
        let (square, tension) = square_at(&believed);
        if (square / least - 1.0) * self.freedom + tension > AGREED * self.freedom {
            (*products, Width::Likelihood)
        } else if self.freedom < GAUSSIAN {
            (believed, Width::Student)
        } else {
            (believed, Width::Gaussian)
        }
    }

    /// The gains to sum over under one correlation, where the slope is the best for each.
    fn gains<'a>(
        &self,
        gain: &'a Coefficient,
        regression: &Regression,
        (products, believed, width): (&Products, &Products, Width),
        nodes: &'a mut Vec<(f64, f64)>,
    ) -> &'a [(f64, f64)] {
        let [(b, _), mut best] = regression.best(believed);
        let slope = self.slope.clamped(b);
        if (slope - b).abs() > 0.0 {
            best = regression.gain_for_slope(believed, slope);
        }
        let (mean, variance) = best;
        let square =
            self.prior_square + regression.residual_square(products, slope, gain.clamped(mean));
        let sd = libm::sqrt(square / self.freedom * variance);
        gain.around(Marginal { mean, sd }, width, nodes)
    }
}

/// Result of a sample of the cells, before all are looked at.
#[derive(Clone, Debug)]
struct Sampled {
    /// The numbers of the correlations that matter.
    correlations: Vec<usize>,
    /// The largest log-mass; no more than that of all cells.
    best: f64,
}

/// One cell under one correlation.
#[derive(Clone, Copy, Debug)]
struct Under<'a> {
    /// The correlation's number.
    number: usize,
    regression: &'a Regression,
    products: &'a Products,
    /// Regressors of the censored segments beyond what their neighbours tell, and the cell's column
    /// in them.
    beyond: &'a [[Row; 2]],
    column: usize,
}

/// Memory that the cells share one after another.
#[derive(Debug, Default)]
struct Scratch {
    explanations: Explanations,
    gains: Vec<(f64, f64)>,
    slopes: Vec<(f64, f64)>,
    scaled: Scaled,
}
