use alloc::vec::Vec;

use foxhunt_core::elementary;

use super::{Marginal, Mixture, Slope};

/// σ of a likelihood, in steps of the prior, below which it has nodes of its own.
const NARROW: f64 = 0.5;

/// Distance in σ of the nodes of a posterior that no limit cuts off: their sum is the integral of
/// a Gaussian to 3 · 10⁻⁴. Near a limit, and of likelihoods, nodes one σ apart reach four σ.
const WIDE: f64 = 1.5;

/// Number of σ that two such nodes on either side reach, with half a step more; of a Gaussian
/// 2 · 10⁻⁴ lie beyond.
const GAUSSIAN_ROOM: f64 = 3.75;

/// Likewise of three nodes; of Student's t with six degrees of freedom 10⁻³ lie beyond.
const STUDENT_ROOM: f64 = 5.25;

/// Density that a peak and a standard deviation belong to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Width {
    /// Readings alone.
    Likelihood,
    /// Readings and prior, with few degrees of freedom.
    Student,
    /// Readings and prior, with many.
    Gaussian,
}

/// Nodes over which a coefficient is summed, given a place and a correlation.
///
/// Prior and readings that agree are nearly Gaussian together: a few of the prior's nodes, or a few
/// about the common peak, hold all of it. Elsewhere the prior's nodes suffice while the
/// likelihood is wide: a sum over nodes two σ apart is the integral of a Gaussian to 1.5 %. Where
/// it is narrower, whole nodes would decide on the place, and nodes about the likelihood's peak
/// take theirs.
#[derive(Clone, Debug)]
pub(super) struct Coefficient {
    nodes: Vec<(f64, f64)>,
    /// Nodes of the same prior about one σ apart.
    wide: Vec<(f64, f64)>,
    /// The least and the greatest value.
    limits: [f64; 2],
    density: Option<Density>,
}

/// A density that is known at any value.
#[derive(Clone, Copy, Debug)]
struct Density {
    gaussian: Marginal,
    /// −½ / sd².
    per_square: f64,
    /// Distance of the prior's nodes, and its logarithm.
    step: f64,
    log_step: f64,
    /// Distance of those that are one σ apart.
    wide_step: f64,
}

impl Density {
    /// Logarithm of the density, less its constant.
    fn log_gaussian(&self, value: f64) -> f64 {
        let deviation = value - self.gaussian.mean;
        self.per_square * deviation * deviation
    }
}

impl Coefficient {
    /// The nodes of a prior.
    pub(super) fn new(prior: &Slope) -> Self {
        let nodes = prior.log_nodes();
        let Slope::Gaussian { mean, sd, lower, upper, step } = *prior else {
            return Self::of(nodes);
        };
        let range = upper - lower;
        let wide_step = (range / libm::round(range / sd).max(1.0)).max(step);
        let mut wide = Slope::Gaussian { mean, sd, lower, upper, step: wide_step }.log_nodes();
        wide.iter_mut().for_each(|node| node.1 += libm::log(wide_step / step));
        let density = Density {
            gaussian: Marginal { mean, sd },
            per_square: -0.5 / (sd * sd),
            step,
            log_step: libm::log(step),
            wide_step,
        };
        Self { wide, density: Some(density), ..Self::of(nodes) }
    }

    fn of(nodes: Vec<(f64, f64)>) -> Self {
        let values = || nodes.iter().map(|node| node.0);
        let least = values().fold(f64::INFINITY, f64::min);
        let greatest = values().fold(f64::NEG_INFINITY, f64::max);
        Self { limits: [least, greatest], nodes, wide: Vec::new(), density: None }
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
        Self::of(alloc::vec![(self.first(), libm::log(total))])
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

    /// The Gaussian of the prior, before the limits cut it off.
    pub(super) fn gaussian(&self) -> Option<Marginal> {
        self.density.map(|density| density.gaussian)
    }

    /// The square of a value's distance from the prior's mean, in its σ; 0 without a mean.
    pub(super) fn tension(&self, value: f64) -> f64 {
        self.density.as_ref().map_or(0.0, |density| -2.0 * density.log_gaussian(value))
    }

    /// The nodes, with the logarithms of their weights, for a density that has its peak at `peak`
    /// and falls from it with the standard deviation `sd`; in `nodes`, where they are not the
    /// prior's.
    pub(super) fn around<'a>(
        &'a self,
        Marginal { mean: peak, sd }: Marginal,
        width: Width,
        nodes: &'a mut Vec<(f64, f64)>,
    ) -> &'a [(f64, f64)] {
        let Some(density) = &self.density else { return &self.nodes };
        if width == Width::Likelihood {
            if !(sd > 0.0 && sd < NARROW * density.step) {
                return &self.nodes;
            }
        } else if !(sd > 0.0 && WIDE * sd < density.wide_step) {
            return &self.wide;
        }
        let [least, greatest] = self.limits;
        let centre = self.clamped(peak);
        let room = (centre - least).min(greatest - centre);
        let (spacing, reach) = match width {
            Width::Gaussian if room > GAUSSIAN_ROOM * sd => (WIDE, 2),
            Width::Student if room > STUDENT_ROOM * sd => (WIDE, 3),
            _ => (1.0, 4),
        };
        // Beyond a limit the likelihood falls from there as an exponential does.
        let step = spacing * sd / ((peak - centre).abs() / sd).max(1.0);
        let log_weight = |value: f64, part: f64| {
            elementary::ln(part) - density.log_step + density.log_gaussian(value)
        };
        let numbers = (-reach..=reach).map(f64::from);
        nodes.clear();
        if room > (f64::from(reach) + 0.5) * step {
            nodes.extend(numbers.map(|number| {
                let value = centre + step * number;
                (value, log_weight(value, step))
            }));
        } else {
            // Of each step the part within the limits.
            nodes.extend(numbers.filter_map(|number| {
                let from = (centre + step * (number - 0.5)).max(least);
                let to = (centre + step * (number + 0.5)).min(greatest);
                let middle = 0.5 * (from + to);
                (to > from).then(|| (middle, log_weight(middle, to - from)))
            }));
        }
        nodes
    }
}
