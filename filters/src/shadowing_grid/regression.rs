use alloc::{vec, vec::Vec};

use foxhunt_core::Pose;

use super::whitener::{LANES, Row, Whitener};

/// The readings, whitened under one correlation length, and cleared of their mean where the
/// intercept is unknown.
#[derive(Clone, Debug)]
pub(super) struct Regression {
    whitener: Whitener,
    /// r = L⁻¹ p, orthogonal to `ones` if the intercept is unknown.
    values: Vec<f64>,
    /// u = L⁻¹ 1; zeros if the intercept is known, so that every term in it vanishes.
    ones: Vec<f64>,
    /// u·u; 1 if the intercept is known.
    ones_square: f64,
    /// r·r.
    value_square: f64,
    /// The intercept of the values alone, u·L⁻¹p / u·u.
    mean: f64,
    /// −½ ln |C| − ½ ln u·u, what the likelihood owes to the correlation length.
    log_scale: f64,
}

/// The products of one cell's whitened regressor x: with them every slope costs O(1).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Products {
    /// x·x, less its part along u.
    square: f64,
    /// x·r.
    value: f64,
    /// x·u / u·u, what a unit of slope takes from the intercept.
    ones: f64,
}

impl Regression {
    /// Factors and whitens; `None` where the correlation is not positive definite.
    pub(super) fn new(
        receivers: &[Pose],
        values: &[f64],
        intercept_is_flat: bool,
        length_m: f64,
        nugget: f64,
    ) -> Option<Self> {
        let whitener = Whitener::new(receivers, length_m, nugget)?;
        let mut rows = vec![[0.0; LANES]; values.len()];
        for (row, value) in rows.iter_mut().zip(values) {
            row[0] = *value;
            row[1] = if intercept_is_flat { 1.0 } else { 0.0 };
        }
        whitener.whiten(&mut rows);
        let ones: Vec<f64> = rows.iter().map(|row| row[1]).collect();
        let ones_square = if intercept_is_flat { ones.iter().map(|u| u * u).sum() } else { 1.0 };
        let mean = rows.iter().map(|row| row[0] * row[1]).sum::<f64>() / ones_square;
        let values: Vec<f64> = rows.iter().map(|row| row[0] - mean * row[1]).collect();
        let value_square = values.iter().map(|r| r * r).sum();
        let log_scale = -whitener.half_log_determinant() - 0.5 * libm::log(ones_square);
        Some(Self { whitener, values, ones, ones_square, value_square, mean, log_scale })
    }

    /// The products of [`LANES`] regressors, one per column of `x`, which is overwritten.
    pub(super) fn products(&self, x: &mut [Row]) -> [Products; LANES] {
        self.whitener.whiten(x);
        let (mut square, mut value, mut ones) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for ((row, r), u) in x.iter().zip(&self.values).zip(&self.ones) {
            for (k, x) in row.iter().enumerate() {
                square[k] += x * x;
                value[k] += x * r;
                ones[k] += x * u;
            }
        }
        core::array::from_fn(|k| Products {
            square: square[k] - ones[k] * ones[k] / self.ones_square,
            value: value[k],
            ones: ones[k] / self.ones_square,
        })
    }

    /// The squared residuals that remain with the slope `b` and the best intercept,
    /// SSR = r·r − 2 b x·r + b² x·x; not below what rounding makes of 0.
    pub(super) fn residual_square(&self, x: &Products, b: f64) -> f64 {
        let explained = b * b * x.square;
        let floor = 1e-14 * (self.value_square + explained) + f64::MIN_POSITIVE;
        (self.value_square - 2.0 * b * x.value + explained).max(floor)
    }

    /// The best intercept with the slope `b`, â = u·(r − b x) / u·u.
    pub(super) fn intercept(&self, x: &Products, b: f64) -> f64 {
        self.mean - b * x.ones
    }

    /// u·u: the intercept's variance is σ² over this.
    pub(super) fn ones_square(&self) -> f64 {
        self.ones_square
    }

    /// The part of the log-likelihood that no cell and no slope changes.
    pub(super) fn log_scale(&self) -> f64 {
        self.log_scale
    }
}
