//! The received level over the area, and where it is highest: no law of propagation.

use alloc::{vec, vec::Vec};

use faer::{Mat, Side, linalg::solvers::Llt};
use foxhunt_core::{
    Belief, Estimate, Pose,
    parameter::{ParameterError, not_negative, positive, require},
};
use nalgebra::Vector2;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use crate::{
    PosteriorMap,
    batch::{BatchError, at_least},
    count::number,
    shadowing_grid::{Grid, Path, Segments, ShadowingGridError, Summary},
};

/// Number of fields drawn at once.
const DRAWN_AT_ONCE: usize = 256;

/// Addition to a cell's variance, as a share of σ², so that rounding leaves a factor.
const JITTER: f64 = 1e-8;

/// Settings of [`FieldMap`]: its model of the level, and its search for the maximum.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldMapConfig {
    /// The lengths, in metres, that the field's correlation may have.
    pub lengths_m: Vec<f64>,
    /// The shares of the variance that may be every reading's own, in (0, 1].
    pub noise_shares: Vec<f64>,
    /// The horizontal length of path, in metres, whose readings are made one; 0 keeps every
    /// reading. Longer where the path would make more than `max_segments`.
    pub segment_m: f64,
    /// The most segments, at least 4: time grows with their cube.
    pub max_segments: u32,
    /// Reach of the search for the maximum beyond the receivers' bounding box, in metres.
    pub margin_m: f64,
    /// The side of a cell in metres; larger where the area would take more than `max_cells`.
    pub cell_m: f64,
    /// The most cells, at least 16: time grows with their cube, memory with their square; 900 take
    /// 10 MB.
    pub max_cells: u32,
    /// Number of fields drawn for the place of the maximum.
    pub samples: u32,
}

/// Lengths of 20, 40, 80, 160 and 320 m; noise shares 0.02, 0.1, 0.3 and 0.6; segments of 10 m, at
/// most 300; margin 50 m, cells of 10 m, at most 900; 500 samples.
impl Default for FieldMapConfig {
    fn default() -> Self {
        Self {
            lengths_m: vec![20.0, 40.0, 80.0, 160.0, 320.0],
            noise_shares: vec![0.02, 0.1, 0.3, 0.6],
            segment_m: 10.0,
            max_segments: 300,
            margin_m: 50.0,
            cell_m: 10.0,
            max_cells: 900,
            samples: 500,
        }
    }
}

impl FieldMapConfig {
    fn check(&self) -> Result<(), BatchError> {
        at_least("lengths_m", self.lengths_m.len(), 1)?;
        at_least("noise_shares", self.noise_shares.len(), 1)?;
        for length_m in &self.lengths_m {
            positive("length_m", *length_m)?;
        }
        for &share in &self.noise_shares {
            require(share > 0.0 && share <= 1.0, "noise_share", share, "in (0, 1]")?;
        }
        not_negative("segment_m", self.segment_m)?;
        not_negative("margin_m", self.margin_m)?;
        positive("cell_m", self.cell_m)?;
        at_least("max_segments", self.max_segments as usize, 4)?;
        at_least("max_cells", self.max_cells as usize, 16)?;
        at_least("samples", self.samples as usize, 1)
    }
}

/// The hyperparameters with the largest marginal likelihood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldModel {
    /// The correlation length ℓ in metres.
    pub length_m: f64,
    /// The share ν of the variance that is every reading's own.
    pub noise_share: f64,
    /// The standard deviation σ of a reading about the mean, in the readings' unit.
    pub sigma: f64,
    /// The mean far from all readings, in their unit.
    pub mean: f64,
}

/// A Gaussian process through the levels that were read along a path (Rasmussen & Williams 2006;
/// kriging with an unknown mean): what the level is at any place, and where it is highest.
///
/// A reading is y = β + f(p) + e with f of Matérn's correlation of smoothness 3/2 and length ℓ,
/// e its own, both together of variance σ². ℓ and e's share of the variance have the largest
/// marginal likelihood on a small grid; they are then taken for known, so that the standard
/// deviation is somewhat too narrow where there are few readings.
///
/// It assumes no law of propagation and no antenna, only that the level varies smoothly with the
/// place over ground. That makes it a baseline: it cannot know of a transmitter that lies outside
/// of where was flown.
///
/// ```
/// use foxhunt_core::{Pose, nalgebra::Vector2};
/// use foxhunt_filters::{FieldMap, FieldMapConfig};
/// let readings: Vec<_> = (0..12)
///     .flat_map(|row| (0..12).map(move |column| (f64::from(row), f64::from(column))))
///     .map(|(row, column)| {
///         let pose = Pose::at(20.0 * column, 20.0 * row, 30.0);
///         let range = (pose.position.xy() - Vector2::new(130.0, 90.0)).norm().hypot(30.0);
///         (pose, -40.0 - 25.0 * range.log10())
///     })
///     .collect();
/// let config = FieldMapConfig { segment_m: 0.0, ..FieldMapConfig::default() };
/// let map = FieldMap::fit(&readings, &config)?;
/// let (near, far) = (map.level(&Vector2::new(130.0, 90.0)), map.level(&Vector2::zeros()));
/// assert!(near.0 > far.0 + 10.0 && near.1 < 1.0);
/// # Ok::<(), foxhunt_filters::BatchError>(())
/// ```
#[derive(Clone, Debug)]
pub struct FieldMap {
    fit: Fit,
    places: Vec<Vector2<f64>>,
    config: FieldMapConfig,
}

impl FieldMap {
    /// The field through readings, each a receiver and a level, in the order in which they were
    /// taken.
    ///
    /// # Errors
    ///
    /// [`BatchError::Parameter`] and [`BatchError::TooFew`] name the setting that is out of range;
    /// [`BatchError::Value`] the reading that is not finite; [`BatchError::TooFew`] where the path
    /// makes fewer than four segments; [`BatchError::Flat`] when all readings were taken in one
    /// place, or have one value.
    pub fn fit(readings: &[(Pose, f64)], config: &FieldMapConfig) -> Result<Self, BatchError> {
        config.check()?;
        let most = config.max_segments as usize;
        let path = Path::new(readings)?;
        let Segments { receivers, values, .. } =
            path.segments(|_| config.segment_m, most, Summary::Quantile(0.5));
        if path.only_place().is_some() {
            return Err(BatchError::Flat { rcond: 0.0 });
        }
        at_least("segments of path", receivers.len(), 4)?;
        let places: Vec<_> = receivers.iter().map(|r| r.position.xy()).collect();
        let shares =
            |length_m: f64| config.noise_shares.iter().map(move |share| (length_m, *share));
        let choices = config.lengths_m.iter().flat_map(|length_m| shares(*length_m));
        let fits = choices.filter_map(|(length, share)| Fit::new(&places, &values, length, share));
        let best = fits.max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
        let fit = best.ok_or(BatchError::Flat { rcond: 0.0 })?;
        Ok(Self { fit, places, config: config.clone() })
    }

    /// The hyperparameters that were chosen.
    #[must_use]
    pub fn model(&self) -> &FieldModel {
        &self.fit.model
    }

    /// The level at a place, East and North in metres, and its standard deviation, both without a
    /// reading's own noise.
    #[must_use]
    pub fn level(&self, place: &Vector2<f64>) -> (f64, f64) {
        let (mean, covariance) = self.levels(core::slice::from_ref(place));
        (mean[0], libm::sqrt(f64::max(0.0, covariance[(0, 0)])))
    }

    /// The levels at some places together: their means and their covariance. With white the
    /// columns of L⁻¹ C(readings, places), that is
    /// σ² ((1 − ν) k − whiteᵀ white + open openᵀ), open = (1 − whiteᵀ u) / √(u·u)
    /// being what the unknown mean leaves open (Rasmussen & Williams 2006, eq. 2.42).
    fn levels(&self, at: &[Vector2<f64>]) -> (Vec<f64>, Mat<f64>) {
        let Fit { correlation, model, residual, .. } = &self.fit;
        let share = 1.0 - model.noise_share;
        let mut white = Mat::<f64>::from_fn(self.places.len(), at.len(), |i, j| {
            share * matern(&self.places[i], &at[j], model.length_m)
        });
        correlation.whiten(&mut white);
        let ones = &correlation.ones;
        let size = libm::sqrt(dot(ones, ones));
        let columns = (0..at.len()).map(|j| column(&white, j));
        let (mean, open): (Vec<f64>, Vec<f64>) = columns
            .map(|white| (model.mean + dot(&white, residual), (1.0 - dot(ones, &white)) / size))
            .unzip();
        let explained = white.transpose() * &white;
        let variance = model.sigma * model.sigma;
        let covariance = Mat::<f64>::from_fn(at.len(), at.len(), |i, j| {
            let before = share * matern(&at[i], &at[j], model.length_m);
            variance * (before - explained[(i, j)] + open[i] * open[j])
        });
        (mean, covariance)
    }

    /// Locates the field's maximum over the receivers' bounding box and a margin about it: the
    /// share of fields, drawn from the posterior, that have their maximum in each cell.
    ///
    /// The generator comes from outside; same seed, same result.
    ///
    /// # Errors
    ///
    /// [`BatchError::Improper`] when the posterior has no factor.
    pub fn maximum<R: Rng>(&self, rng: &mut R) -> Result<FieldMaximum, BatchError> {
        let grid = self.grid();
        let samples = self.config.samples;
        let places: Vec<_> = (0..grid.len()).map(|cell| grid.centre(cell)).collect();
        let (mean, factor) = self.posterior(&places)?;
        let mut wins = vec![0_u32; places.len()];
        let mut left = samples as usize;
        while left > 0 {
            let count = left.min(DRAWN_AT_ONCE);
            left -= count;
            let white = Mat::<f64>::from_fn(places.len(), count, |_, _| rng.sample(StandardNormal));
            let fields = factor.L() * &white;
            for j in 0..count {
                let level = |i: usize| mean[i] + fields[(i, j)];
                wins[highest(places.len(), level)] += 1;
            }
        }
        let share = |wins: &u32| f64::from(*wins) / f64::from(samples);
        let map = PosteriorMap::new(grid, wins.iter().map(share).collect());
        let highest_mean = places[highest(places.len(), |i| mean[i])];
        Ok(FieldMaximum { position: map.estimate(), highest_mean, map })
    }

    fn grid(&self) -> Grid {
        let nowhere = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        let (low, high) =
            self.places.iter().fold(nowhere, |(low, high), p| (low.inf(p), high.sup(p)));
        let margin = Vector2::repeat(self.config.margin_m);
        Grid::over(low - margin, high + margin, self.config.cell_m, self.config.max_cells)
    }

    /// The mean and a factor of the covariance of the levels at some places together.
    fn posterior(&self, places: &[Vector2<f64>]) -> Result<(Vec<f64>, Llt<f64>), BatchError> {
        let (mean, mut covariance) = self.levels(places);
        let sigma = self.model().sigma;
        (0..places.len()).for_each(|i| covariance[(i, i)] += JITTER * sigma * sigma);
        let factor = Llt::new(covariance.as_ref(), Side::Lower);
        let improper = BatchError::Improper { what: "field's posterior" };
        Ok((mean, factor.map_err(|_| improper)?))
    }
}

/// Place where a field is highest.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldMaximum {
    /// The mean and covariance of the place of the maximum, East and North in metres.
    pub position: Estimate<2>,
    /// The centre of the cell with the largest expected level.
    pub highest_mean: Vector2<f64>,
    /// The probability that the maximum lies in each cell.
    pub map: PosteriorMap,
}

/// The cells with a probability, as a planner sees them.
impl Belief for FieldMaximum {
    fn position(&self) -> Estimate<2> {
        self.position
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        let cells = self.map.cells().filter(|&(_, mass)| mass > 0.0);
        cells.for_each(|(place, mass)| visit(&place, mass));
    }
}

/// A field given its readings, for one choice of hyperparameters.
#[derive(Clone, Debug)]
struct Fit {
    correlation: Correlation,
    model: FieldModel,
    /// L⁻¹ (y − β 1).
    residual: Vec<f64>,
    /// ln p(y | ℓ, ν) with β and σ integrated out, but for a constant.
    log_likelihood: f64,
}

impl Fit {
    /// The mean β has a flat prior and σ the prior 1/σ; both are integrated out of the
    /// likelihood |C|^−½ (u·u)^−½ SSR^(−(n−1)/2) with u = L⁻¹ 1 (Handcock & Stein 1993,
    /// eq. 8); `None` where C has no factor or the readings no spread.
    fn new(
        places: &[Vector2<f64>],
        values: &[f64],
        length_m: f64,
        noise_share: f64,
    ) -> Option<Self> {
        let correlation = Correlation::new(places, length_m, noise_share)?;
        let mut white = Mat::<f64>::from_fn(values.len(), 1, |i, _| values[i]);
        correlation.whiten(&mut white);
        let mut residual = column(&white, 0);
        let ones = dot(&correlation.ones, &correlation.ones);
        let mean = dot(&correlation.ones, &residual) / ones;
        for (residual, one) in residual.iter_mut().zip(&correlation.ones) {
            *residual -= mean * one;
        }
        let squares = dot(&residual, &residual);
        let freedom = number(values.len()) - 1.0;
        let log_likelihood = -correlation.half_log_determinant()
            - 0.5 * libm::log(ones)
            - 0.5 * freedom * libm::log(squares);
        let sigma = libm::sqrt(squares / freedom);
        let model = FieldModel { length_m, noise_share, sigma, mean };
        let proper = log_likelihood.is_finite() && sigma > 0.0;
        proper.then_some(Self { correlation, model, residual, log_likelihood })
    }
}

/// The readings' correlation, factored: C = L Lᵀ.
#[derive(Clone, Debug)]
struct Correlation {
    factor: Llt<f64>,
    /// u = L⁻¹ 1.
    ones: Vec<f64>,
}

impl Correlation {
    /// `C_ij = (1 − ν) k(|pᵢ − pⱼ|/ℓ) + ν δ_ij`; `None` where it has no factor.
    fn new(places: &[Vector2<f64>], length_m: f64, noise_share: f64) -> Option<Self> {
        let n = places.len();
        let matrix = Mat::<f64>::from_fn(n, n, |i, j| match i == j {
            true => 1.0,
            false => (1.0 - noise_share) * matern(&places[i], &places[j], length_m),
        });
        let factor = Llt::new(matrix.as_ref(), Side::Lower).ok()?;
        let mut correlation = Self { factor, ones: Vec::new() };
        let mut ones = Mat::<f64>::from_fn(n, 1, |_, _| 1.0);
        correlation.whiten(&mut ones);
        correlation.ones = column(&ones, 0);
        Some(correlation)
    }

    /// Replaces X by L⁻¹ X.
    fn whiten(&self, x: &mut Mat<f64>) {
        self.factor.L().solve_lower_triangular_in_place(x.as_mut());
    }

    /// ½ ln |C|.
    fn half_log_determinant(&self) -> f64 {
        let factor = self.factor.L();
        (0..factor.nrows()).map(|i| libm::log(factor[(i, i)])).sum()
    }
}

/// Converts the reason that a path made no segments.
impl From<ShadowingGridError> for BatchError {
    fn from(error: ShadowingGridError) -> Self {
        let improper = |name, index, value| {
            let error = ParameterError { name, value, requirement: "finite" };
            Self::Value { index, error }
        };
        match error {
            ShadowingGridError::Parameter(error) => Self::Parameter(error),
            ShadowingGridError::Value { index, value } => improper("the level", index, value),
            ShadowingGridError::Receiver { index } => {
                improper("the receiver's pose", index, f64::NAN)
            }
            ShadowingGridError::TooFew { segments, .. } => {
                Self::TooFew { what: "segments of path", have: segments, need: 4 }
            }
            _ => Self::Flat { rcond: 0.0 },
        }
    }
}

/// The index with the largest level.
fn highest(count: usize, level: impl Fn(usize) -> f64) -> usize {
    (0..count).max_by(|a, b| level(*a).total_cmp(&level(*b))).unwrap_or_default()
}

/// Matérn's correlation of smoothness 3/2, (1 + √3 d/ℓ) exp(−√3 d/ℓ) (Rasmussen &
/// Williams 2006, eq. 4.17): a field that has slopes and no more, as a level near its transmitter.
fn matern(a: &Vector2<f64>, b: &Vector2<f64>, length_m: f64) -> f64 {
    let scaled = libm::sqrt(3.0) * (a - b).norm() / length_m;
    (1.0 + scaled) * libm::exp(-scaled)
}

/// A column's numbers.
fn column(matrix: &Mat<f64>, j: usize) -> Vec<f64> {
    (0..matrix.nrows()).map(|i| matrix[(i, j)]).collect()
}

/// Σ aᵢ bᵢ.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    /// The likelihood is the density of contrasts, which know nothing of the mean; written out
    /// again with Helmert's.
    #[test]
    fn the_likelihood_is_that_of_the_contrasts() {
        let places: Vec<Vector2<f64>> =
            [(0.0, 0.0), (30.0, 5.0), (70.0, -20.0), (10.0, 60.0), (55.0, 41.0)]
                .map(|(east, north)| Vector2::new(east, north))
                .to_vec();
        let values = [3.0, -1.0, 4.0, 1.5, -5.0];
        let n = places.len();
        let helmert = DMatrix::from_fn(n - 1, n, |i, j| {
            let k = number(i + 1);
            let size = libm::sqrt(k * (k + 1.0));
            if j <= i {
                1.0 / size
            } else if j == i + 1 {
                -k / size
            } else {
                0.0
            }
        });
        let contrasts = &helmert * DVector::from_row_slice(&values);
        let oracle = |length_m: f64, share: f64| {
            let c = DMatrix::from_fn(n, n, |i, j| {
                let scaled = libm::sqrt(3.0) * (places[i] - places[j]).norm() / length_m;
                let own = if i == j { share } else { 0.0 };
                (1.0 - share) * (1.0 + scaled) * libm::exp(-scaled) + own
            });
            let c = &helmert * c * helmert.transpose();
            let squares = contrasts.dot(&c.clone().lu().solve(&contrasts).expect("regular"));
            -0.5 * libm::log(c.determinant()) - 0.5 * number(n - 1) * libm::log(squares)
        };
        let fit = |length_m: f64, share: f64| {
            Fit::new(&places, &values, length_m, share).expect("regular").log_likelihood
        };
        let first = fit(20.0, 0.1) - oracle(20.0, 0.1);
        for (length_m, share) in [(80.0, 0.1), (300.0, 0.5), (40.0, 0.9)] {
            let error = fit(length_m, share) - oracle(length_m, share) - first;
            assert!(error.abs() < 1e-10, "off by {error} at {length_m} m, {share}");
        }
    }
}
