use alloc::{vec, vec::Vec};

use super::{LANES, Marginal, NEIGHBOURS, Row};
use crate::vecchia::{Correlation, Neighbours, Receivers, Whitener};

/// The readings, whitened under one correlation length and nugget, and cleared of their mean where
/// the intercept is unknown.
#[derive(Clone, Debug)]
pub(super) struct Regression {
    whitener: Whitener<NEIGHBOURS>,
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
    /// −½ ln |C| − ½ ln u·u, what the likelihood owes to the correlation.
    log_scale: f64,
}

/// The products of one cell's whitened regressors, x of the slope and g of the gain: with them
/// every pair of coefficients costs O(1).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Products {
    /// x·x and g·g, less their parts along u.
    squares: [f64; 2],
    /// x·g, less its part along u.
    cross: f64,
    /// x·r and g·r.
    values: [f64; 2],
    /// x·u / u·u and g·u / u·u, what a unit of a coefficient takes from the intercept.
    ones: [f64; 2],
}

impl Products {
    /// The products with a Gaussian prior of each coefficient as one more reading, where residuals
    /// have some variance.
    pub(super) fn with_priors(mut self, priors: [Option<Marginal>; 2], variance: f64) -> Self {
        for ((prior, square), value) in
            priors.into_iter().zip(&mut self.squares).zip(&mut self.values)
        {
            let Some(Marginal { mean, sd }) = prior else { continue };
            let weight = variance / (sd * sd);
            *square += weight;
            *value += weight * mean;
        }
        self
    }
}

impl Regression {
    /// Factors and whitens; `None` where the correlation is not positive definite. One value more
    /// than there are receivers is a calibration's, with its variance.
    pub(super) fn new(
        (receivers, neighbours): (Receivers<'_>, &Neighbours<NEIGHBOURS>),
        values: &[f64],
        calibration: Option<f64>,
        intercept_is_flat: bool,
        correlation: Correlation,
    ) -> Option<Self> {
        let whitener = Whitener::new(receivers, neighbours, correlation)?;
        let whitener = match calibration {
            Some(variance) => whitener.with_independent(variance),
            None => whitener,
        };
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

    /// The products of [`LANES`] pairs of regressors, one per column of `x` and `g`, which are
    /// overwritten; `g` is empty where the gain is known to be 0.
    pub(super) fn products(&self, x: &mut [Row], g: &mut [Row]) -> [Products; LANES] {
        self.whitener.whiten(x);
        self.whitener.whiten(g);
        let [mut xx, mut xr, mut xu] = [[0.0; LANES]; 3];
        for ((row, r), u) in x.iter().zip(&self.values).zip(&self.ones) {
            for (k, x) in row.iter().enumerate() {
                xx[k] += x * x;
                xr[k] += x * r;
                xu[k] += x * u;
            }
        }
        let [mut gg, mut gx, mut gr, mut gu] = [[0.0; LANES]; 4];
        for (((row, x), r), u) in g.iter().zip(&*x).zip(&self.values).zip(&self.ones) {
            for (k, g) in row.iter().enumerate() {
                gg[k] += g * g;
                gx[k] += g * x[k];
                gr[k] += g * r;
                gu[k] += g * u;
            }
        }
        let per_one = 1.0 / self.ones_square;
        core::array::from_fn(|k| Products {
            squares: [xx[k] - xu[k] * xu[k] * per_one, gg[k] - gu[k] * gu[k] * per_one],
            cross: gx[k] - gu[k] * xu[k] * per_one,
            values: [xr[k], gr[k]],
            ones: [xu[k] * per_one, gu[k] * per_one],
        })
    }

    /// The squared residuals that remain with the slope `b`, the gain `c` and the best intercept,
    /// SSR = |r − b x − c g|²; not below what rounding makes of 0.
    pub(super) fn residual_square(&self, products: &Products, b: f64, c: f64) -> f64 {
        let Products { squares, cross, values, .. } = products;
        let explained = b * b * squares[0] + 2.0 * b * c * cross + c * c * squares[1];
        let floor = 1e-14 * (self.value_square + explained) + f64::MIN_POSITIVE;
        (self.value_square - 2.0 * (b * values[0] + c * values[1]) + explained).max(floor)
    }

    /// The best slope with the gain `c`, with the variance that it has for residuals of variance 1;
    /// 0 and infinite where the regressor is the same for all readings.
    pub(super) fn slope_for_gain(&self, products: &Products, c: f64) -> (f64, f64) {
        quotient(products.values[0] - c * products.cross, products.squares[0])
    }

    /// The best gain with the slope `b`, likewise.
    pub(super) fn gain_for_slope(&self, products: &Products, b: f64) -> (f64, f64) {
        quotient(products.values[1] - b * products.cross, products.squares[1])
    }

    /// The best slope with the best gain, and the best gain with the best slope, likewise.
    pub(super) fn best(&self, products: &Products) -> [(f64, f64); 2] {
        let Products { squares: [xx, gg], cross, values: [xr, gr], .. } = *products;
        let alone = |square: f64, other: f64| {
            if other > 0.0 { square - cross * cross / other } else { square }
        };
        let of_gain = if gg > 0.0 { cross / gg } else { 0.0 };
        let of_slope = if xx > 0.0 { cross / xx } else { 0.0 };
        [quotient(xr - of_gain * gr, alone(xx, gg)), quotient(gr - of_slope * xr, alone(gg, xx))]
    }

    /// The best intercept with the slope `b` and the gain `c`, â = u·(r − b x − c g) / u·u.
    pub(super) fn intercept(&self, products: &Products, b: f64, c: f64) -> f64 {
        self.mean - b * products.ones[0] - c * products.ones[1]
    }

    /// Returns the decrease of the best intercept per unit of each coefficient.
    pub(super) fn intercept_slopes(&self, products: &Products) -> [f64; 2] {
        products.ones
    }

    /// u·u: the intercept's variance is σ² over this.
    pub(super) fn ones_square(&self) -> f64 {
        self.ones_square
    }

    /// The part of the log-likelihood that no cell and no coefficient changes.
    pub(super) fn log_scale(&self) -> f64 {
        self.log_scale
    }
}

/// A coefficient from its product with the values and its square, with its variance.
fn quotient(product: f64, square: f64) -> (f64, f64) {
    if square > 0.0 { (product / square, 1.0 / square) } else { (0.0, f64::INFINITY) }
}
