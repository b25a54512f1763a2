//! Localisation of a transmitter of unknown power, from many spatially correlated readings at once.
//!
//! The readings, thinned along the path, are `value_i = a + b x_i(cell) + c g_i(cell) + e_i` with
//! e ~ N(0, σ² C): neighbours fade together (Gudmundson 1991). On every cell of a grid a and σ
//! are integrated out in closed form (Handcock & Stein 1993), b, c and the correlation by sums;
//! what remains is the posterior of the target's place, an average over all these explanations
//! by their evidence.

mod cells;
mod censored;
mod coefficient;
mod config;
mod explanations;
mod grid;
mod likelihood;
mod locate;
mod path;
mod regression;
mod search;

pub use config::{Intercept, PlacePrior, ShadowingGridConfig, ShadowingGridError, Slope};
pub use grid::PosteriorMap;
#[cfg(feature = "batch")]
pub(crate) use locate::bounds;
pub use locate::{ShadowingFix, ShadowingGrid};
pub use path::{Censoring, ShadowedReading};

#[cfg(feature = "field-map")]
pub(crate) use path::{Path, Segments, Summary};
#[cfg(feature = "batch")]
pub(crate) use {
    grid::Grid,
    search::{Search, climb},
};

/// Right-hand sides that are solved side by side: their sums fill the vector registers.
const LANES: usize = 16;

/// One row of [`LANES`] right-hand sides.
type Row = [f64; LANES];

/// Earlier readings that each reading is conditioned on, at most: the correlation e^(−d/ℓ) has
/// little memory beyond the nearest.
const NEIGHBOURS: usize = 12;

/// The posterior mean and standard deviation of one number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Marginal {
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub sd: f64,
}

/// The first two moments of a mixture, component by component.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Mixture {
    weight: f64,
    mean: f64,
    /// Σ w (variance + (mean − mixture's mean)²).
    spread: f64,
}

impl Mixture {
    /// Adds a component (West 1979): no difference of large squares.
    pub(crate) fn add(&mut self, weight: f64, mean: f64, variance: f64) {
        if weight <= 0.0 {
            return;
        }
        let before = self.weight;
        self.weight += weight;
        let step = mean - self.mean;
        self.mean += step * weight / self.weight;
        self.spread += weight * variance + step * step * before * weight / self.weight;
    }

    /// The mean.
    pub(crate) fn mean(&self) -> f64 {
        self.mean
    }

    /// The variance: that of the components and that between them.
    pub(crate) fn variance(&self) -> f64 {
        if self.weight > 0.0 { self.spread / self.weight } else { 0.0 }
    }

    /// The numbers with their probabilities.
    pub(crate) fn of(numbers: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut mixture = Self::default();
        numbers.for_each(|(number, probability)| mixture.add(probability, number, 0.0));
        mixture
    }

    /// Mean and standard deviation.
    pub(crate) fn marginal(&self) -> Marginal {
        Marginal { mean: self.mean, sd: libm::sqrt(self.variance()) }
    }
}

/// Weight, first and second moment of a number about a reference that is not far from it.
#[derive(Clone, Copy, Debug)]
struct Moments {
    reference: f64,
    weight: f64,
    first: f64,
    second: f64,
}

impl Moments {
    /// No weight as yet.
    fn about(reference: f64) -> Self {
        Self { reference, weight: 0.0, first: 0.0, second: 0.0 }
    }

    /// Adds values of some weight, with their first and second moment.
    fn add_sums(&mut self, weight: f64, [first, second]: [f64; 2]) {
        self.weight += weight;
        self.first += first;
        self.second += second;
    }

    /// Mean and standard deviation.
    fn marginal(&self) -> Marginal {
        let mean = self.first / self.weight;
        let variance = (self.second / self.weight - mean * mean).max(0.0);
        Marginal { mean: self.reference + mean, sd: libm::sqrt(variance) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn a_mixture_has_the_variance_of_its_parts_and_between_them() {
        let mut mixture = Mixture::default();
        mixture.add(1.0, 1e6, 4.0);
        mixture.add(0.0, f64::NAN, f64::NAN); // no weight, no effect
        mixture.add(3.0, 1e6 + 8.0, 1.0);
        assert_abs_diff_eq!(mixture.mean(), 1e6 + 6.0, epsilon = 1e-9);
        // (4 + 3 · 1) / 4 within and (36 + 3 · 4) / 4 between.
        assert_abs_diff_eq!(mixture.variance(), 13.75, epsilon = 1e-9);
        assert_abs_diff_eq!(mixture.marginal().sd, libm::sqrt(13.75), epsilon = 1e-9);
    }
}
