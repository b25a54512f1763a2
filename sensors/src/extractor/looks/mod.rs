//! The readings of a turn by boresight, and the posterior of the bearing over a turn.

mod direct;
mod likelihood;
mod station;

pub use direct::{FirstHarmonic, MainLobeFit, Maximum};
pub use likelihood::{
    CrossCorrelation, CrossCorrelationConfig, MaximumLikelihood, MaximumLikelihoodConfig, Residuals,
};
pub use station::{StationAntenna, StationModel, StationPattern};

pub(crate) use station::{LOST, TAIL, lobe_db, log_student};

use alloc::vec::Vec;
use core::f64::consts::{FRAC_1_SQRT_2, TAU};

use foxhunt_core::{BearingModes, NoReading, Pose, Sweep, angle, elementary};

use super::pattern::check;

/// Readings whose boresights differ by less than this, in radians, are of one look: a quarter of
/// a degree to either side changes the gain of a 30° lobe by less than 0.01 dB on average.
const SAME_LOOK: f64 = 0.0087;

/// Below this an antenna is level, in radians.
const LEVEL: f64 = 0.0175;

/// Step of a receiver that reports whole dB: the variance of rounding is its square over 12
/// (Sheppard 1898), and no spread of readings shows less of it.
const ROUNDING_VARIANCE: f64 = 1.0 / 12.0;

/// Losses are taken to have the density Beta(1, 3) before a turn: any share, rather a small one.
const PRIOR_LOST: f64 = 1.0;
const PRIOR_NOT_LOST: f64 = 3.0;

/// Expectation and maximisation in turn settle a level to a hundredth of a dB within as many.
const ROUNDS: u32 = 12;

/// Number of bearings over a turn that are fitted, one to every second degree; the posterior is
/// interpolated between them.
const NODES: u16 = 180;

/// Peaks of at most this share of the total weight are dropped.
const LEAST_WEIGHT: f64 = 0.01;

/// Peaks nearer to each other than this many of their σ together are one.
const APART: f64 = 1.5;

/// A density lower than the highest by this factor's logarithm adds less than 1e-10.
const NEGLIGIBLE: f64 = 25.0;

/// One lower by this factor's logarithm, 5e-5, is read once a node.
const FAINT: f64 = 10.0;

/// Readings of a turn along one boresight.
#[derive(Clone, Copy, Debug)]
struct Look {
    /// Boresight in radians counter-clockwise of the turn's first one.
    offset: f64,
    /// Position and tilt of the body.
    receiver: Pose,
    /// The boresight in radians counter-clockwise of the nose.
    mount: f64,
    /// The mean of the readings in dB.
    mean_dbm: f64,
    /// Number of readings.
    count: f64,
}

/// A turn's readings gathered by boresight, each with its own: bins of a turning body are not all
/// looked through along their nominal angle.
///
/// Angles are counted from the first boresight, so that a sweep that is turned as a whole gives
/// the same numbers.
#[derive(Clone, Debug)]
struct Looks {
    looks: Vec<Look>,
    /// Zero of the angles, in the world frame.
    origin: f64,
    /// The sum of squares of the readings about their look's mean, in dB².
    scatter: f64,
    /// Degrees of freedom of the scatter.
    freedom: f64,
    /// Readings come in whole dB.
    whole_db: bool,
    /// The antenna is nowhere tilted by more than a degree.
    level: bool,
    /// The largest pitch or roll, in radians.
    tilt: f64,
}

impl Looks {
    fn new(sweep: &Sweep<'_>) -> Result<Self, NoReading> {
        check(sweep)?;
        let origin = sweep.samples.first().map_or(0.0, |sample| sample.boresight);
        let mut of_position: Vec<Option<usize>> = Vec::new();
        of_position.resize(usize::from(sweep.positions), None);
        let mut looks: Vec<Look> = Vec::with_capacity(of_position.len());
        let tilt = |pose: &Pose| pose.pitch.abs().max(pose.roll.abs());
        let tilt = sweep.samples.iter().map(|s| tilt(&s.receiver)).fold(0.0, f64::max);
        let level = tilt < LEVEL;
        let mut scatter = 0.0;
        let mut freedom = 0.0;
        let mut whole_db = true;
        for sample in sweep.samples {
            whole_db &= (sample.rss_dbm - libm::round(sample.rss_dbm)).abs() < 1e-9;
            let Pose { pitch, roll, .. } = sample.receiver;
            let offset = angle::wrap(sample.boresight - origin);
            let same = |look: &Look| {
                let tilt = |pose: &Pose| (pose.pitch - pitch).abs().max((pose.roll - roll).abs());
                // An antenna without a direction looks everywhere, however its drone turns.
                sweep.positions == 1
                    || angle::distance(look.offset, offset) < SAME_LOOK
                        && (level || tilt(&look.receiver) < SAME_LOOK)
            };
            let last = &mut of_position[usize::from(sample.position)];
            match last.and_then(|index| looks.get_mut(index)).filter(|look| same(look)) {
                Some(look) => {
                    let off = sample.rss_dbm - look.mean_dbm;
                    look.count += 1.0;
                    look.mean_dbm += off / look.count;
                    scatter += off * (sample.rss_dbm - look.mean_dbm);
                    freedom += 1.0;
                }
                None => {
                    *last = Some(looks.len());
                    let receiver = sample.receiver;
                    let mount = angle::wrap(sample.boresight - receiver.heading);
                    looks.push(Look {
                        offset,
                        receiver,
                        mount,
                        mean_dbm: sample.rss_dbm,
                        count: 1.0,
                    });
                }
            }
        }
        Ok(Self { looks, origin, scatter, freedom, whole_db, level, tilt })
    }

    /// The variance of a reading about its look's mean: the turn's scatter, pooled with a prior of
    /// `sigma_db` that counts for `prior_freedom` degrees of freedom.
    fn sample_variance(&self, sigma_db: f64, prior_freedom: f64) -> f64 {
        let pooled =
            (self.scatter + prior_freedom * sigma_db * sigma_db) / (self.freedom + prior_freedom);
        if self.whole_db { pooled.max(ROUNDING_VARIANCE) } else { pooled }
    }

    /// Number of looks, as a number to reckon with.
    fn len(&self) -> f64 {
        self.looks.iter().map(|_| 1.0).sum()
    }

    /// The mean over the looks and the root mean square about it, in dB.
    fn spread(&self) -> (f64, f64) {
        let mean = self.looks.iter().map(|look| look.mean_dbm).sum::<f64>() / self.len();
        let square = |look: &Look| (look.mean_dbm - mean) * (look.mean_dbm - mean);
        (mean, libm::sqrt(self.looks.iter().map(square).sum::<f64>() / self.len()))
    }
}

/// The likelihood of questions without an answer, for a receiver with a known floor: each was
/// either lost, with a probability that is not known, or its power was below the floor (Tobin
/// 1958).
#[derive(Clone, Debug)]
struct Silence {
    /// The antenna's directions, counted like the looks'.
    offsets: Vec<f64>,
    /// The power below which nothing is read, in dBm.
    threshold_dbm: f64,
    answered: f64,
}

/// A level and the silence's part of its log likelihood.
#[derive(Clone, Copy, Debug)]
struct Settled {
    level: f64,
    log_likelihood: f64,
}

impl Silence {
    /// `None` where nothing can be learned from it.
    fn new(sweep: &Sweep<'_>, looks: &Looks) -> Option<Self> {
        let floor = sweep.floor_dbm.filter(|floor| floor.is_finite())?;
        let unanswered = sweep.unanswered.iter().filter(|u| u.boresight.is_finite());
        let offsets: Vec<f64> =
            unanswered.map(|u| angle::wrap(u.boresight - looks.origin)).collect();
        // A receiver that rounds reports the floor from half a step below it on.
        let threshold_dbm = if looks.whole_db { floor - 0.5 } else { floor };
        let answered = looks.looks.iter().map(|look| look.count).sum();
        (!offsets.is_empty()).then_some(Self { offsets, threshold_dbm, answered })
    }

    /// Returns true if a silent boresight's power may have been below the floor, at a level: within
    /// three σ of it or lower.
    fn matters(&self, level: f64, variance: f64, gain: impl Fn(f64) -> f64) -> bool {
        let reach = self.threshold_dbm + 3.0 * libm::sqrt(variance);
        self.offsets.iter().any(|offset| level + gain(*offset) < reach)
    }

    /// The level that the received readings, in information form, and the silence give together, by
    /// expectation and maximisation over losses and over the powers that were not received
    /// (Dempster, Laird & Rubin 1977). `expected` gives the gain along each silent boresight
    /// and the variance of a reading there.
    fn settle(&self, information: f64, weighted: f64, expected: &[(f64, f64)]) -> Settled {
        let mut level = weighted / information;
        let mut lost = 0.1;
        let requested = self.answered + expected.iter().map(|_| 1.0).sum::<f64>();
        for _ in 0..ROUNDS {
            let mut sum = weighted;
            let mut known = information;
            let mut losses = 0.0;
            for &(gain, variance) in expected {
                let mean = level + gain;
                let sigma = libm::sqrt(variance);
                let x = (self.threshold_dbm - mean) / sigma;
                let below = normal_cdf(x);
                let weak = (1.0 - lost) * below / (lost + (1.0 - lost) * below);
                losses += 1.0 - weak;
                if below > 1e-300 {
                    let hazard = libm::exp(-0.5 * x * x) / (libm::sqrt(TAU) * below);
                    let imputed = mean - sigma * hazard;
                    sum += weak / variance * (imputed - gain);
                    known += weak / variance;
                }
            }
            level = sum / known;
            lost = (PRIOR_LOST + losses) / (PRIOR_LOST + PRIOR_NOT_LOST + requested);
        }
        let kept = libm::log1p(-lost);
        let mut log_likelihood =
            PRIOR_LOST * libm::log(lost) + (PRIOR_NOT_LOST + self.answered) * kept;
        for &(gain, variance) in expected {
            let below = normal_cdf((self.threshold_dbm - level - gain) / libm::sqrt(variance));
            log_likelihood += libm::log(lost + (1.0 - lost) * below);
        }
        Settled { level, log_likelihood }
    }
}

/// A fit at one bearing.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    /// The logarithm of the density up to a constant.
    log_density: f64,
    /// The level that goes with it, in dBm, and its variance in dB² were the bearing known.
    level: f64,
    level_variance: f64,
}

/// One bearing that the readings may have come from, with the moments of the density about it.
#[derive(Clone, Copy, Debug, Default)]
struct Peak {
    weight: f64,
    offset: f64,
    sigma: f64,
    level: f64,
    level_variance: f64,
    /// Covariance of level and bearing, in dB rad.
    covariance: f64,
}

/// The peaks and moments of a density over bearings, in the order of their angles.
#[derive(Clone, Debug)]
struct Posterior {
    /// The logarithm of its integral, up to the constant of the log densities.
    log_mass: f64,
    peaks: Vec<Peak>,
}

impl Posterior {
    /// The posterior from the log density at equal steps over a turn.
    ///
    /// Between the nodes the logarithm goes along the cubic through four of them: it is smooth on
    /// the scale of the antenna's lobes, however narrow its exponential is.
    fn new(nodes: &[Node]) -> Self {
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
    fn log_mass(&self) -> f64 {
        self.log_mass
    }

    /// This or another, with their masses for weights.
    fn or(mut self, other: Self) -> Self {
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
    fn blurred(mut self, sigma: f64) -> Self {
        for peak in &mut self.peaks {
            peak.sigma = libm::hypot(peak.sigma, sigma);
        }
        self
    }

    /// The bearings that compete, most likely first, with weights that sum to one.
    fn modes(self) -> Vec<Peak> {
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

/// Φ(x).
pub(crate) fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * FRAC_1_SQRT_2)
}

/// The bearing of a node, counted like the looks.
fn node_offset(node: u16) -> f64 {
    TAU * f64::from(node) / f64::from(NODES)
}

/// The bearings that compete, most likely first, from the log density at equal steps over a turn.
fn peaks(nodes: &[Node]) -> Vec<Peak> {
    Posterior::new(nodes).modes()
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
fn summit(nodes: &[Node]) -> (f64, f64) {
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

/// An angle between 0 and a turn.
fn wrapped(angle: f64) -> f64 {
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
    use approx::assert_abs_diff_eq;
    use foxhunt_core::Sample;

    #[test]
    fn a_level_that_goes_with_the_direction_is_uncertain_by_it() {
        let nodes = nodes(|angle| -0.5 * ((angle - 3.0) / 0.2).powi(2), |angle| 10.0 * angle);
        let [peak] = peaks(&nodes)[..] else { panic!("one peak") };
        // 0.25 dB² of each direction, and (10 dB/rad · 0.2 rad)².
        assert_abs_diff_eq!(peak.level_variance, 4.25, epsilon = 0.01);
        assert_abs_diff_eq!(peak.covariance, 0.4, epsilon = 0.002);
    }

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

    #[test]
    fn an_antenna_that_tilts_the_other_way_looks_elsewhere() {
        let looks = |tilts: [f64; 2]| {
            let samples = tilts.map(|pitch| Sample {
                time: 0.0,
                receiver: Pose { pitch, ..Pose::default() },
                boresight: 0.0,
                position: 0,
                rss_dbm: -60.5,
            });
            let sweep = Sweep { positions: 8, samples: &samples, ..Sweep::default() };
            Looks::new(&sweep).expect("readings").looks.len()
        };
        assert_eq!(looks([0.1, 0.1 - 0.5 * SAME_LOOK]), 1);
        assert_eq!([looks([0.1, -0.1]), looks([-0.1, 0.1])], [2, 2]);
        assert_eq!(looks([0.5 * LEVEL, -0.5 * LEVEL]), 1);
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
                assert_abs_diff_eq!(peak.covariance / (3.0 * sigma * sigma), 1.0, epsilon = 0.1);
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
            assert_abs_diff_eq!(peak.weight, weight, epsilon = 1e-3);
            let off = foxhunt_core::angle::distance(peak.offset, offset);
            assert!(off < 1e-3, "{peak:?}");
        }
    }

    #[test]
    fn a_flat_density_is_one_wide_peak() {
        let found = Posterior::new(&nodes(|_| -3.0, |_| 0.0)).modes();
        assert_eq!(found.len(), 1);
        assert_abs_diff_eq!(found[0].sigma, TAU / libm::sqrt(12.0), epsilon = 0.01);
    }
}
