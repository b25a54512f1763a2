use alloc::vec::Vec;

use super::{
    Slope,
    config::log_gaussian,
    marginal::{Marginal, Mixture},
};

/// Nodes over which a coefficient is summed, given a place and a correlation.
///
/// The prior's nodes suffice while the likelihood is wide: a sum over nodes two σ apart is the
/// integral of a Gaussian to 1.5 %. Where it is narrower, whole nodes would decide on the place,
/// and nodes about the likelihood's peak take theirs.
#[derive(Clone, Debug)]
pub(super) struct Coefficient {
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
    pub(super) fn new(prior: &Slope) -> Self {
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
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The first node: the value where it is known.
    pub(super) fn first(&self) -> f64 {
        self.nodes.first().map_or(0.0, |node| node.0)
    }

    /// The coefficient held at the prior's first node, with the prior's whole weight.
    pub(super) fn held(&self) -> Self {
        let total: f64 = self.nodes.iter().map(|(_, log_weight)| libm::exp(*log_weight)).sum();
        Self::of(alloc::vec![(self.first(), libm::log(total))], None)
    }

    /// Mean and standard deviation before any reading.
    pub(super) fn prior(&self) -> Marginal {
        let nodes = self.nodes.iter();
        Mixture::of(nodes.map(|&(value, log_weight)| (value, libm::exp(log_weight)))).marginal()
    }

    /// The value within the prior's limits that is nearest to another.
    pub(super) fn clamped(&self, value: f64) -> f64 {
        let [least, greatest] = self.limits;
        value.max(least).min(greatest)
    }

    /// The nodes, with the logarithms of their weights, for a likelihood that has its peak at
    /// `peak` and falls from it as a Gaussian of standard deviation `sd`; in `nodes`, where they
    /// are not the prior's.
    pub(super) fn around<'a>(
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
