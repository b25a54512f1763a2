use alloc::vec::Vec;
use core::ops::Range;

use foxhunt_core::elementary;

use crate::vectorised::{Kernel, dot, largest, run, sum};

/// Pairs of coefficients that may explain a cell, one correlation after another, in columns.
#[derive(Clone, Debug, Default)]
pub(super) struct Explanations {
    /// Slopes and gains, less their reference values.
    slopes: Vec<f64>,
    gains: Vec<f64>,
    /// Squared residuals, and the squares of the prior of σ.
    squares: Vec<f64>,
    /// Log-weights at first, then log-masses, then weights relative to the largest.
    masses: Vec<f64>,
    /// End of the explanations of each correlation.
    ends: Vec<usize>,
    /// Memory for products.
    products: Vec<f64>,
}

/// Weighted sums over the explanations of one correlation.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub weight: f64,
    /// First and second moment of the slope, and of the gain.
    pub slope: [f64; 2],
    pub gain: [f64; 2],
    /// Mixed moment of slope and gain.
    pub cross: f64,
    /// Sums of the squares' roots, and of the squares.
    pub root: f64,
    pub square: f64,
}

impl Explanations {
    /// Removes all explanations and keeps the memory.
    pub(super) fn clear(&mut self) {
        let Self { slopes, gains, squares, masses, products, ends } = self;
        for column in [slopes, gains, squares, masses, products] {
            column.clear();
        }
        ends.clear();
    }

    /// Adds slopes with the logarithms of their weights, under one gain.
    pub(super) fn extend(
        &mut self,
        nodes: &[(f64, f64)],
        [slope, gain]: [f64; 2],
        c: f64,
        log_weight: f64,
        square_of: impl Fn(f64) -> f64,
    ) {
        self.slopes.extend(nodes.iter().map(|(b, _)| b - slope));
        self.gains.extend(nodes.iter().map(|_| c - gain));
        self.squares.extend(nodes.iter().map(|(b, _)| square_of(*b)));
        self.masses.extend(nodes.iter().map(|(_, b_weight)| b_weight + log_weight));
    }

    /// Ends the explanations of one correlation.
    pub(super) fn end(&mut self) {
        self.ends.push(self.squares.len());
    }

    /// Turns log-weights into log-masses, less the power of the squares, and returns the largest.
    pub(super) fn set_log_masses(&mut self, power: f64) -> f64 {
        run(LogMasses { squares: &self.squares, masses: &mut self.masses, power })
    }

    /// Turns log-masses into weights relative to the largest.
    pub(super) fn set_weights(&mut self, peak: f64) {
        run(Weights { squares: &mut self.squares, masses: &mut self.masses, peak });
    }

    fn part(&self, part: usize) -> Range<usize> {
        let begin = part.checked_sub(1).and_then(|before| self.ends.get(before));
        begin.copied().unwrap_or(0)..self.ends.get(part).copied().unwrap_or(0)
    }

    /// Returns slope, gain, square and log-mass of the explanations of a correlation.
    pub(super) fn part_mut(
        &mut self,
        part: usize,
    ) -> impl Iterator<Item = (f64, f64, f64, &mut f64)> {
        let range = self.part(part);
        let coefficients = self.slopes.iter().zip(&self.gains).zip(&self.squares);
        let all = coefficients.zip(&mut self.masses).skip(range.start).take(range.len());
        all.map(|(((b, c), square), log_mass)| (*b, *c, *square, log_mass))
    }

    /// Returns the sums over the explanations of a correlation.
    pub(super) fn sums(&mut self, part: usize) -> Sums {
        let range = self.part(part);
        self.products.resize(self.squares.len(), 0.0);
        let Self { slopes, gains, squares, masses, products, .. } = self;
        let columns = [slopes, gains, squares, masses].map(|column| column.get(range.clone()));
        let ([Some(slopes), Some(gains), Some(squares), Some(weights)], Some(products)) =
            (columns, products.get_mut(range))
        else {
            return Sums::default();
        };
        run(Summed { slopes, gains, squares, weights, products })
    }
}

/// Logarithms of all masses.
struct LogMasses<'a> {
    squares: &'a [f64],
    masses: &'a mut [f64],
    power: f64,
}

impl Kernel for LogMasses<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        for (mass, square) in self.masses.iter_mut().zip(self.squares) {
            let log_mass = *mass - self.power * elementary::ln(*square);
            *mass = if log_mass.is_nan() { f64::NEG_INFINITY } else { log_mass };
        }
        largest(self.masses)
    }
}

/// Weights of all masses.
struct Weights<'a> {
    squares: &'a mut [f64],
    masses: &'a mut [f64],
    peak: f64,
}

impl Kernel for Weights<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (mass, square) in self.masses.iter_mut().zip(self.squares) {
            *mass = elementary::exp(*mass - self.peak);
            // An infinite square has no weight, and no part in a sum.
            *square = if *mass > 0.0 { *square } else { 0.0 };
        }
    }
}

/// Sums over one correlation.
struct Summed<'a> {
    slopes: &'a [f64],
    gains: &'a [f64],
    squares: &'a [f64],
    weights: &'a [f64],
    /// Memory for the products of the weights with another column.
    products: &'a mut [f64],
}

impl Kernel for Summed<'_> {
    type Output = Sums;

    #[inline(always)]
    fn run(self) -> Sums {
        let Self { slopes, gains, squares, weights, products } = self;
        let set = |products: &mut [f64], of: &[f64]| {
            for ((product, weight), of) in products.iter_mut().zip(weights).zip(of) {
                *product = weight * of;
            }
        };
        set(products, slopes);
        let slope = [sum(products), dot(products, slopes)];
        let cross = dot(products, gains);
        set(products, gains);
        let gain = [sum(products), dot(products, gains)];
        for (product, square) in products.iter_mut().zip(squares) {
            *product = elementary::sqrt(*square);
        }
        let root = dot(weights, products);
        Sums { weight: sum(weights), slope, gain, cross, root, square: dot(weights, squares) }
    }
}
