use alloc::vec::Vec;
use core::f64::consts::TAU;

use foxhunt_core::{BearingModes, elementary};

/// Number of bearings over a turn that are fitted, one to every second degree; the posterior is
/// interpolated between them.
pub(super) const NODES: u16 = 180;

/// The bearing of a node, counted like the looks.
pub(super) fn node_offset(node: u16) -> f64 {
    TAU * f64::from(node) / f64::from(NODES)
}

/// A fit at one bearing.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::extractor) struct Node {
    /// The logarithm of the density up to a constant.
    pub(in crate::extractor) log_density: f64,
    /// The level that goes with it, in dBm, and its variance in dB² were the bearing known.
    pub(in crate::extractor) level: f64,
    pub(in crate::extractor) level_variance: f64,
}

/// One bearing that the readings may have come from, with the moments of the density about it.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::extractor) struct Peak {
    pub(in crate::extractor) weight: f64,
    pub(in crate::extractor) offset: f64,
    pub(in crate::extractor) sigma: f64,
    pub(in crate::extractor) level: f64,
    pub(in crate::extractor) level_variance: f64,
    /// Covariance of level and bearing, in dB rad.
    pub(in crate::extractor) covariance: f64,
}

/// Peaks of at most this share of the total weight are dropped.
const LEAST_WEIGHT: f64 = 0.01;

/// Peaks nearer to each other than this many of their σ together are one.
const APART: f64 = 1.5;

/// A density lower than the highest by this factor's logarithm adds less than 1e-10.
const NEGLIGIBLE: f64 = 25.0;

/// One lower by this factor's logarithm, 5e-5, is read once a node.
const FAINT: f64 = 10.0;

/// The bearings that compete, most likely first, from the log density at equal steps over a turn.
pub(in crate::extractor) fn peaks(nodes: &[Node]) -> Vec<Peak> {
    Posterior::new(nodes).modes()
}

/// The peaks and moments of a density over bearings, in the order of their angles.
#[derive(Clone, Debug)]
pub(super) struct Posterior {
    /// The logarithm of its integral, up to the constant of the log densities.
    log_mass: f64,
    peaks: Vec<Peak>,
}

impl Posterior {
    /// The posterior from the log density at equal steps over a turn.
    ///
    /// Between the nodes the logarithm goes along the cubic through four of them: it is smooth on
    /// the scale of the antenna's lobes, however narrow its exponential is.
    pub(super) fn new(nodes: &[Node]) -> Self {
        let n = nodes.len();
        let log = |i: usize| nodes[i % n].log_density;
        let is_peak = |i: &usize| log(*i) >= log(i + n - 1) && log(*i) > log(i + 1);
        let tops: Vec<usize> = (0..n).filter(is_peak).collect();
        let best = tops.iter().map(|&top| height(nodes, top)).fold(log(0), f64::max);
        let sums: Vec<Sums> = if tops.is_empty() {
            alloc::vec![Sums::over(nodes, 0, n, best)]
        } else {
            let valley = |from: usize, to: usize| {
                let to = if to > from { to } else { to + n };
                (from..to).fold(from, |low, i| if log(i) < log(low) { i } else { low })
            };
            let next = |k: usize| tops[(k + 1) % tops.len()];
            let ends: Vec<usize> = (0..tops.len()).map(|k| valley(tops[k], next(k))).collect();
            (0..tops.len())
                .map(|k| {
                    let begin = ends[(k + tops.len() - 1) % tops.len()] % n;
                    let end = ends[k] % n;
                    Sums::over(nodes, begin, if end > begin { end } else { end + n }, best)
                })
                .collect()
        };
        let total: f64 = sums.iter().map(Sums::weight).sum();
        let peaks = sums.iter().map(|sum| sum.peak(total)).collect();
        Self { log_mass: best + libm::log(total), peaks }
    }

    /// The logarithm of its integral, up to the constant of the log densities.
    pub(super) fn log_mass(&self) -> f64 {
        self.log_mass
    }

    /// This or another, with their masses for weights.
    pub(super) fn or(mut self, other: Self) -> Self {
        let best = self.log_mass.max(other.log_mass);
        let mine = libm::exp(self.log_mass - best);
        let others = libm::exp(other.log_mass - best);
        let scaled = |peaks: Vec<Peak>, factor: f64| {
            peaks.into_iter().map(move |peak| Peak { weight: factor * peak.weight, ..peak })
        };
        let total = mine + others;
        self.peaks =
            scaled(self.peaks, mine / total).chain(scaled(other.peaks, others / total)).collect();
        self.peaks.sort_by(|a, b| a.offset.total_cmp(&b.offset));
        Self { log_mass: best + libm::log(total), ..self }
    }

    /// Adds `sigma` radians of independent error to every direction.
    pub(super) fn blurred(mut self, sigma: f64) -> Self {
        for peak in &mut self.peaks {
            peak.sigma = libm::hypot(peak.sigma, sigma);
        }
        self
    }

    /// The bearings that compete, most likely first, with weights that sum to one.
    pub(super) fn modes(self) -> Vec<Peak> {
        let mut peaks = self.peaks;
        peaks.retain(|peak| peak.weight > LEAST_WEIGHT);
        merge(&mut peaks);
        peaks.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        peaks.truncate(BearingModes::CAPACITY);
        let kept: f64 = peaks.iter().map(|peak| peak.weight).sum();
        for peak in &mut peaks {
            peak.weight /= kept;
        }
        peaks
    }
}

/// Offset from a peak of the top of the parabola through it and its neighbours, in nodes, and the
/// parabola's bend.
fn parabola(nodes: &[Node], top: usize) -> (f64, f64) {
    let log = |i: usize| nodes[i % nodes.len()].log_density;
    let before = log(top + nodes.len() - 1);
    let at = log(top);
    let after = log(top + 1);
    let bend = 2.0 * at - before - after;
    if bend > 0.0 { (0.5 * (after - before) / bend, bend) } else { (0.0, 0.0) }
}

/// The log density at a peak's top, which between the nodes may be far above theirs.
fn height(nodes: &[Node], top: usize) -> f64 {
    let (off, bend) = parabola(nodes, top);
    nodes[top % nodes.len()].log_density + 0.5 * bend * off * off
}

/// The most likely bearing, and the level there.
pub(in crate::extractor) fn summit(nodes: &[Node]) -> (f64, f64) {
    let n = nodes.len();
    let log = |i: &usize| nodes[*i].log_density;
    let top = (0..n).fold(0, |top, i| if log(&i) > log(&top) { i } else { top });
    let (off, _) = parabola(nodes, top);
    let level = |i: usize| nodes[i % n].level;
    let slope =
        if off > 0.0 { level(top + 1) - level(top) } else { level(top) - level(top + n - 1) };
    #[expect(clippy::cast_precision_loss, reason = "there are a few hundred nodes")]
    let offset = (top as f64 + off) * (TAU / n as f64);
    (offset, level(top) + off * slope)
}

/// Merges neighbours that cannot be separated.
fn merge(peaks: &mut Vec<Peak>) {
    let mut i = 0;
    while peaks.len() > 1 && i < peaks.len() {
        let j = (i + 1) % peaks.len();
        let a = peaks[i];
        let b = peaks[j];
        let apart = foxhunt_core::angle::wrap(b.offset - a.offset);
        if apart.abs() >= APART * (a.sigma + b.sigma) {
            i += 1;
            continue;
        }
        let weight = a.weight + b.weight;
        let mine = a.weight / weight;
        let other = b.weight / weight;
        let rise = b.level - a.level;
        let between = mine * other;
        peaks[i] = Peak {
            weight,
            offset: a.offset + other * apart,
            sigma: libm::sqrt(
                mine * a.sigma * a.sigma + other * b.sigma * b.sigma + between * apart * apart,
            ),
            level: a.level + other * rise,
            level_variance: mine * a.level_variance
                + other * b.level_variance
                + between * rise * rise,
            covariance: mine * a.covariance + other * b.covariance + between * apart * rise,
        };
        peaks.remove(j);
        i = 0;
    }
}

/// Sums over a stretch of the circle, angles counted from the stretch's first node.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    begin: f64,
    one: f64,
    angle: f64,
    angle_square: f64,
    level: f64,
    level_square: f64,
    product: f64,
    level_variance: f64,
    base_level: f64,
}

impl Sums {
    fn over(nodes: &[Node], begin: usize, end: usize, best: f64) -> Self {
        let n = nodes.len();
        #[expect(clippy::cast_precision_loss, reason = "there are a few hundred nodes")]
        let (step, start) = (TAU / n as f64, begin as f64);
        let node = |i: usize| nodes[(i + n) % n];
        let log = |i: usize| node(i).log_density;
        let top = (begin..=end).fold(begin, |top, i| if log(i) > log(top) { i } else { top });
        // Eight points to a standard deviation; the nodes alone where it is wide.
        let bend = 2.0 * log(top) - log(top + n - 1) - log(top + 1);
        let per_node = libm::ceil(8.0 * libm::sqrt(bend.max(0.0))).clamp(1.0, 8000.0);
        let mut sums = Self { begin: start * step, base_level: node(top).level, ..Self::default() };
        for i in begin..end {
            let near = (top + n).abs_diff(i + n) <= 2;
            let below = best - log(i).max(log(i + 1));
            if !near && below > 2.0 * NEGLIGIBLE {
                continue;
            }
            let per_node = if !near && below > FAINT { 1.0 } else { per_node };
            let along = [log(i + n - 1), log(i), log(i + 1), log(i + 2)];
            let a = node(i);
            let b = node(i + 1);
            let mut k = 0.0;
            while k < per_node {
                let t = (k + 0.5) / per_node;
                let log_density = cubic(along, t);
                let density = elementary::exp(log_density - best) / per_node;
                #[expect(clippy::cast_precision_loss, reason = "as above")]
                let angle = ((i - begin) as f64 + t) * step;
                let level = a.level + t * (b.level - a.level) - sums.base_level;
                sums.one += density;
                sums.angle += density * angle;
                sums.angle_square += density * angle * angle;
                sums.level += density * level;
                sums.level_square += density * level * level;
                sums.product += density * angle * level;
                sums.level_variance +=
                    density * (a.level_variance + t * (b.level_variance - a.level_variance));
                k += 1.0;
            }
        }
        sums
    }

    fn weight(&self) -> f64 {
        self.one
    }

    fn peak(&self, total: f64) -> Peak {
        if self.one <= 0.0 {
            return Peak::default();
        }
        let angle = self.angle / self.one;
        let level = self.level / self.one;
        Peak {
            weight: self.one / total,
            offset: wrapped(self.begin + angle),
            sigma: libm::sqrt((self.angle_square / self.one - angle * angle).max(0.0)),
            level: self.base_level + level,
            level_variance: self.level_variance / self.one
                + (self.level_square / self.one - level * level).max(0.0),
            covariance: self.product / self.one - angle * level,
        }
    }
}

/// An angle between 0 and a turn.
pub(super) fn wrapped(angle: f64) -> f64 {
    angle - TAU * libm::floor(angle / TAU)
}

/// The cubic through four equally spaced values, at `t` between the middle two.
fn cubic([a, b, c, d]: [f64; 4], t: f64) -> f64 {
    let (cubed, squared, linear) =
        ((d - a) / 6.0 + 0.5 * (b - c), 0.5 * (a + c) - b, c - d / 6.0 - 0.5 * b - a / 3.0);
    ((cubed * t + squared) * t + linear) * t + b
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nodes(log_density: impl Fn(f64) -> f64, level: impl Fn(f64) -> f64) -> Vec<Node> {
        (0..180_u16)
            .map(|i| {
                let angle = TAU * f64::from(i) / 180.0;
                let log_density = log_density(angle);
                let level = level(angle);
                Node { log_density, level, level_variance: 0.25 }
            })
            .collect()
    }

    /// A von Mises density of κ has σ² = 1/κ + 1/(2κ²) + O(κ⁻³).
    #[test]
    fn moments_of_one_bearing_are_those_of_its_density() {
        for kappa in [20.0, 1e3, 1e6] {
            for at in [0.0, 1.234, 6.25] {
                let read = nodes(|a| kappa * libm::cos(a - at), |a| 3.0 * libm::sin(a - at) - 50.0);
                let found = Posterior::new(&read).modes();
                assert_eq!(found.len(), 1);
                let peak = found[0];
                assert!(foxhunt_core::angle::distance(peak.offset, at) < 1e-5, "{peak:?}");
                let sigma = libm::sqrt(1.0 / kappa + 0.5 / (kappa * kappa));
                assert!((peak.sigma / sigma - 1.0).abs() < 0.01, "κ {kappa}: {peak:?}");
                assert!((peak.covariance / (3.0 * sigma * sigma) - 1.0).abs() < 0.1, "{peak:?}");
            }
        }
    }

    #[test]
    fn two_bearings_have_their_weights() {
        let two = |a: f64| {
            libm::log(
                0.75 * libm::exp(200.0 * (libm::cos(a - 1.0) - 1.0))
                    + 0.25 * libm::exp(200.0 * (libm::cos(a - 4.0) - 1.0)),
            )
        };
        let found = Posterior::new(&nodes(two, |_| 0.0)).modes();
        assert_eq!(found.len(), 2);
        for (peak, (weight, offset)) in found.iter().zip([(0.75, 1.0), (0.25, 4.0)]) {
            assert!((peak.weight - weight).abs() < 1e-3, "{peak:?}");
            let off = foxhunt_core::angle::distance(peak.offset, offset);
            assert!(off < 1e-3, "{peak:?}");
        }
    }

    #[test]
    fn a_flat_density_is_one_wide_peak() {
        let found = Posterior::new(&nodes(|_| -3.0, |_| 0.0)).modes();
        assert_eq!(found.len(), 1);
        assert!((found[0].sigma - TAU / libm::sqrt(12.0)).abs() < 0.01);
    }
}
