//! Localisation of a transmitter of unknown power, from many spatially correlated readings at once.
//!
//! The readings, thinned along the path, are `value_i = a + b x_i(cell) + c g_i(cell) + e_i` with
//! e ~ N(0, σ² C): neighbours fade together (Gudmundson 1991). On every cell of a grid a and σ
//! are integrated out in closed form (Handcock & Stein 1993), b, c and the correlation by sums;
//! what remains is the posterior of the target's place, an average over all these explanations
//! by their evidence.

mod cells;
mod censored;
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

use alloc::vec::Vec;

use config::log_gaussian;

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

/// Nodes over which a coefficient is summed, given a place and a correlation.
///
/// The prior's nodes suffice while the likelihood is wide: a sum over nodes two σ apart is the
/// integral of a Gaussian to 1.5 %. Where it is narrower, whole nodes would decide on the place,
/// and nodes about the likelihood's peak take theirs.
#[derive(Clone, Debug)]
struct Coefficient {
    nodes: Vec<(f64, f64)>,
    /// The least and the greatest value.
    limits: [f64; 2],
    density: Option<Density>,
}

/// A density that is known at any value.
#[derive(Clone, Copy, Debug)]
struct Density {
    mean: f64,
    sd: f64,
    step: f64,
}

impl Coefficient {
    /// The nodes of a prior.
    fn new(prior: &Slope) -> Self {
        let density = match *prior {
            Slope::Gaussian { mean, sd, step, .. } => Some(Density { mean, sd, step }),
            Slope::Known(_) | Slope::Nodes(_) => None,
        };
        Self::of(prior.log_nodes(), density)
    }

    fn of(nodes: Vec<(f64, f64)>, density: Option<Density>) -> Self {
        let values = || nodes.iter().map(|node| node.0);
        let least = values().fold(f64::INFINITY, f64::min);
        let greatest = values().fold(f64::NEG_INFINITY, f64::max);
        Self { limits: [least, greatest], nodes, density }
    }

    /// Returns the number of the prior's nodes.
    fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The first node: the value where it is known.
    fn first(&self) -> f64 {
        self.nodes.first().map_or(0.0, |node| node.0)
    }

    /// The coefficient held at the prior's first node, with the prior's whole weight.
    fn held(&self) -> Self {
        let total: f64 = self.nodes.iter().map(|(_, log_weight)| libm::exp(*log_weight)).sum();
        Self::of(alloc::vec![(self.first(), libm::log(total))], None)
    }

    /// Mean and standard deviation before any reading.
    fn prior(&self) -> Marginal {
        let nodes = self.nodes.iter();
        Mixture::of(nodes.map(|&(value, log_weight)| (value, libm::exp(log_weight)))).marginal()
    }

    /// The value within the prior's limits that is nearest to another.
    fn clamped(&self, value: f64) -> f64 {
        let [least, greatest] = self.limits;
        value.max(least).min(greatest)
    }

    /// The nodes, with the logarithms of their weights, for a likelihood that has its peak at
    /// `peak` and falls from it as a Gaussian of standard deviation `sd`; in `nodes`, where they
    /// are not the prior's.
    fn around<'a>(
        &'a self,
        peak: f64,
        sd: f64,
        nodes: &'a mut Vec<(f64, f64)>,
    ) -> &'a [(f64, f64)] {
        let density = self.density.as_ref();
        let Some(density) = density.filter(|own| sd > 0.0 && sd < NARROW * own.step) else {
            return &self.nodes;
        };
        nodes.clear();
        let centre = self.clamped(peak);
        // Beyond a limit the likelihood falls from there as an exponential does.
        let step = sd / ((peak - centre).abs() / sd).max(1.0);
        let [least, greatest] = self.limits;
        for i in -REACH..=REACH {
            // The part of the node's step that lies within the limits.
            let value = centre + step * f64::from(i);
            let from = (value - 0.5 * step).max(least);
            let to = (value + 0.5 * step).min(greatest);
            if to > from {
                let middle = 0.5 * (from + to);
                let log_share = libm::log((to - from) / density.step);
                nodes.push((middle, log_share + log_gaussian(middle, density.mean, density.sd)));
            }
        }
        nodes
    }
}

/// σ of a likelihood, in steps of the prior, below which it has nodes of its own.
const NARROW: f64 = 0.5;

/// Number of σ over which a likelihood's own nodes reach on either side; of a Gaussian 10⁻⁴
/// lie beyond.
const REACH: i32 = 4;

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
