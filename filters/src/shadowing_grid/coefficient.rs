use alloc::vec::Vec;
use core::f64::consts::LN_2;

use super::{
    Slope,
    config::log_gaussian,
    marginal::{Marginal, Mixture},
};

/// Nodes over which a coefficient is summed, given a place and a correlation.
///
/// Where the likelihood is wide for the prior's nodes, these do: a sum over nodes two σ apart is
/// the integral of a Gaussian to 1 %. Where it is narrower, whole nodes would decide on the place,
/// and nodes about the likelihood's peak take theirs.
#[derive(Clone, Debug)]
pub(super) struct Coefficient {
    nodes: Vec<(f64, f64)>,
    density: Option<Density>,
}

/// A density that is known at any value.
#[derive(Clone, Copy, Debug)]
struct Density {
    mean: f64,
    sd: f64,
    lower: f64,
    upper: f64,
    step: f64,
}

impl Coefficient {
    /// The nodes of a prior.
    pub(super) fn new(prior: &Slope) -> Self {
        let density = match *prior {
            Slope::Gaussian { mean, sd, lower, upper, step } => {
                Some(Density { mean, sd, lower, upper, step })
            }
            Slope::Known(_) | Slope::Nodes(_) => None,
        };
        Self { nodes: prior.log_nodes(), density }
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
        Self { nodes: alloc::vec![(self.first(), libm::log(total))], density: None }
    }

    /// Mean and standard deviation before any reading.
    pub(super) fn prior(&self) -> Marginal {
        let nodes = self.nodes.iter();
        Mixture::of(nodes.map(|&(value, log_weight)| (value, libm::exp(log_weight)))).marginal()
    }

    /// The value within the prior's limits that is nearest to another.
    pub(super) fn clamped(&self, value: f64) -> f64 {
        match &self.density {
            Some(density) => value.clamp(density.lower, density.upper),
            None => value,
        }
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
        let log_share = libm::log(step / density.step);
        for i in -REACH..=REACH {
            let value = centre + step * f64::from(i);
            if (density.lower..=density.upper).contains(&value) {
                let at_limit = i == 0 && (peak - centre).abs() > 0.0;
                let log_own = if at_limit { log_share - LN_2 } else { log_share };
                nodes.push((value, log_own + log_gaussian(value, density.mean, density.sd)));
            }
        }
        nodes
    }
}

/// σ of a likelihood, in steps of the prior, below which it has nodes of its own.
const NARROW: f64 = 0.5;

/// Number of σ over which a likelihood's own nodes reach on either side: 10⁻⁴ lie beyond.
const REACH: i32 = 4;
