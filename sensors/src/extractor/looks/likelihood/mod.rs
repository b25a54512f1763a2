//! A turn laid against an antenna whose gain is known: residuals, how far they exceed the noise,
//! and the reading.

mod extractors;
mod judge;
mod superposed;
mod tables;
mod two_paths;

pub use extractors::{
    CrossCorrelation, CrossCorrelationConfig, MaximumLikelihood, MaximumLikelihoodConfig, Residuals,
};

use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use foxhunt_core::{
    Bearing, BearingMode, BearingModes, NoBearing, Reading, Sweep,
    angle::{self, Resultant},
};

use super::{Look, Looks, NODES, Node, Peak, Silence, node_offset, normal_cdf};
use crate::{
    Antenna,
    extractor::{Pattern, resultant_confidence},
};
use tables::GainTable;

/// Lags are counted in classes of 5°, up to short of half a turn: beyond it a pair is met from its
/// other look.
const LAGS: u16 = 36;

/// Shift of the classes' limits, as a share of a class: the limits then lie where the steps of no
/// usual turn do, so that rounding moves no lag across one.
const BETWEEN: f64 = 0.37;

/// Fewer looks than this do not show correlation.
const FEWEST: f64 = 16.0;

/// Residuals with less than this share of the promised mean square come from a turn without noise,
/// in which nothing but rounding correlates.
const NOTHING: f64 = 0.01;

/// Number of residuals of the promised size that are added.
const PROMISED: f64 = 4.0;

/// Least σ of a bearing, in radians: half a thousandth of a degree, so that no observation has a
/// σ of zero.
const LEAST_SIGMA: f64 = 1e-5;

/// The moving mean's window for the confidence, that of the reference extractor.
const WINDOW: u16 = 7;

/// A turn laid against a known antenna: the data that all ways of judging residuals share.
#[derive(Debug)]
struct Fit<'a, A> {
    antenna: &'a A,
    table: &'a GainTable,
    looks: Looks,
    /// The variance of each look's mean in dB², without the misfit of the pattern.
    variances: Vec<f64>,
    /// The variance of a single reading.
    single_variance: f64,
    silence: Option<Silence>,
}

impl<'a, A: Antenna> Fit<'a, A> {
    fn new(
        antenna: &'a A,
        table: &'a GainTable,
        looks: Looks,
        sweep: &Sweep<'_>,
        sample_variance: f64,
        misfit_variance: f64,
    ) -> Self {
        let of_mean = |count: f64| sample_variance / count + misfit_variance;
        let variances = looks.looks.iter().map(|look| of_mean(look.count)).collect();
        let silence = Silence::new(sweep, &looks);
        let single_variance = sample_variance + misfit_variance;
        Self { antenna, table, looks, variances, single_variance, silence }
    }

    /// The turn's received looks, with other variances.
    fn measured(&self, variances: Vec<f64>) -> Self {
        Self { variances, looks: self.looks.clone(), silence: None, ..*self }
    }

    /// Returns true if some of the silence may be weakness, for a signal from `offset`.
    fn is_censored(&self, offset: f64, level: f64) -> bool {
        let gain = |silent: f64| self.table.at(offset - silent);
        self.silence.as_ref().is_some_and(|s| s.matters(level, self.single_variance, gain))
    }

    /// The gain about its mean along each look, for a signal from `offset`.
    fn gains(&self, offset: f64, out: &mut Vec<f64>) {
        out.clear();
        if self.looks.level {
            out.extend(self.looks.looks.iter().map(|look| self.table.at(offset - look.offset)));
        } else {
            let bearing = self.looks.origin + offset;
            let tilted = |look| self.table.tilted(self.antenna, look, bearing);
            out.extend(self.looks.looks.iter().map(tilted));
        }
    }

    /// The gain about its mean along one look, for a signal from each node.
    #[inline(always)]
    fn gains_of(&self, look: &Look, out: &mut [f64; NODES as usize]) {
        if self.looks.level {
            return self.table.around(-look.offset, out);
        }
        for (node, out) in (0..NODES).zip(out) {
            let bearing = self.looks.origin + node_offset(node);
            *out = self.table.tilted(self.antenna, look, bearing);
        }
    }

    /// The slope of the gain along each look over the bearing, in dB per radian.
    fn slopes(&self, offset: f64) -> Vec<f64> {
        const STEP: f64 = 0.0087;
        let mut before = Vec::new();
        let mut after = Vec::new();
        self.gains(offset - STEP, &mut before);
        self.gains(offset + STEP, &mut after);
        before.iter().zip(&after).map(|(a, b)| (b - a) / (2.0 * STEP)).collect()
    }

    /// Residual of each look's mean at a level and a bearing, in dB.
    fn residuals(&self, offset: f64, level: f64) -> Vec<f64> {
        let mut gains = Vec::new();
        self.gains(offset, &mut gains);
        let looks = self.looks.looks.iter();
        looks.zip(&gains).map(|(look, gain)| look.mean_dbm - gain - level).collect()
    }

    /// The Cramér-Rao bound of the bearing's variance, in rad², at a bearing and a level that is
    /// not known either; `None` where nothing bounds it. Looks and silent boresights alike count
    /// with what a reading there tells on average, received or below the floor.
    fn bound(&self, offset: f64, level: f64) -> Option<f64> {
        let mut tt = 0.0;
        let mut tl = 0.0;
        let mut ll = 0.0;
        let mut add = |gain: f64, slope: f64, variance: f64| {
            let below = self.silence.as_ref().map_or(f64::INFINITY, |silence| {
                (level + gain - silence.threshold_dbm) / libm::sqrt(self.single_variance)
            });
            let information = uncensored(below) / variance;
            tt += information * slope * slope;
            tl += information * slope;
            ll += information;
        };
        let mut gains = Vec::new();
        self.gains(offset, &mut gains);
        let slopes = self.slopes(offset);
        for ((gain, slope), variance) in gains.iter().zip(&slopes).zip(&self.variances) {
            add(*gain, *slope, *variance);
        }
        for silent in self.silence.iter().flat_map(|silence| &silence.offsets) {
            let (gain, slope) = self.table.with_slope(offset - silent);
            add(gain, slope, self.single_variance);
        }
        let known = tt - tl * tl / ll;
        (known > 0.0 && known.is_finite()).then(|| 1.0 / known)
    }

    /// A node from the received looks' log density at its best level, its information and its
    /// information-weighted sum, and from the silence.
    fn node(
        &self,
        offset: f64,
        (log_density, information, weighted): (f64, f64, f64),
        extra_variance: impl Fn(f64) -> f64,
    ) -> Node {
        let best = weighted / information;
        let node = Node { log_density, level: best, level_variance: 1.0 / information };
        let Some(silence) = &self.silence else { return node };
        let expected: Vec<(f64, f64)> = silence
            .offsets
            .iter()
            .map(|silent| {
                let azimuth = offset - silent;
                (self.table.at(azimuth), self.single_variance + extra_variance(azimuth))
            })
            .collect();
        let settled = silence.settle(information, weighted, &expected);
        let off = settled.level - best;
        Node {
            log_density: log_density - 0.5 * information * off * off + settled.log_likelihood,
            level: settled.level,
            ..node
        }
    }
}

/// Comparison of a fit's residuals with the looks' variances.
#[derive(Clone, Copy, Debug)]
struct Misfit {
    /// The root mean square of the residuals, in dB.
    residual_db: f64,
    /// The mean square over the promised one, if that is more: the factor by which all variances
    /// are too small.
    scale: f64,
    /// Loss by neighbours erring alike: the variance of the bearing over that with independent
    /// residuals.
    correlation: f64,
}

impl Misfit {
    /// Compares the residuals at a bearing, with `fitted` unknowns fitted.
    fn new<A: Antenna>(fit: &Fit<'_, A>, offset: f64, residuals: &[f64], fitted: f64) -> Self {
        let squares = || residuals.iter().map(|r| r * r);
        let weighted: f64 = squares().zip(&fit.variances).map(|(r, v)| r / v).sum();
        let count = fit.looks.len();
        // With few looks χ² is uncertain: a promise counts as much as four of them.
        let scale = (weighted + PROMISED) / (count - fitted + PROMISED).max(1.0);
        Self {
            residual_db: libm::sqrt(squares().sum::<f64>() / count),
            scale: scale.max(1.0),
            correlation: if count < FEWEST || weighted < NOTHING * count {
                1.0
            } else {
                correlated(fit, offset, residuals)
            },
        }
    }
}

impl Misfit {
    /// Factor that all variances have to be multiplied by.
    fn inflation(&self) -> f64 {
        self.scale * self.correlation
    }
}

/// A look's residual and its slope about the mean one, over σ.
#[derive(Clone, Copy)]
struct Residual {
    offset: f64,
    normal: f64,
    slope: f64,
}

/// Limits that a fit must keep to be a bearing.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Limits {
    rss_sigma_db: f64,
    /// Largest σ of a bearing, in radians.
    max_sigma: f64,
    min_positions: u16,
}

/// Moments of level and bearing over several peaks.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    level: f64,
    level_square: f64,
    bearing: f64,
    product: f64,
    weight: f64,
    base: Option<f64>,
}

impl Moments {
    fn add(&mut self, peak: &Peak, off: f64) {
        let base = *self.base.get_or_insert(peak.level);
        let level = peak.level - base;
        self.weight += peak.weight;
        self.level += peak.weight * level;
        self.level_square += peak.weight * (level * level + peak.level_variance);
        self.bearing += peak.weight * off;
        self.product += peak.weight * (level * off + peak.covariance);
    }

    /// The level, its variance, and its covariance with the bearing.
    fn finish(&self) -> (f64, f64, f64) {
        let level = self.level / self.weight;
        let bearing = self.bearing / self.weight;
        (
            self.base.unwrap_or_default() + level,
            (self.level_square / self.weight - level * level).max(0.0),
            self.product / self.weight - level * bearing,
        )
    }
}

/// The Fisher information about its mean of a reading whose mean lies `above` σ above the floor,
/// censored below it, over that of one that is always received: P(z > −x) − x φ(x) +
/// φ(x)²/Φ(−x).
fn uncensored(above: f64) -> f64 {
    let below = normal_cdf(-above);
    if below < 1e-12 {
        return 1.0;
    }
    let density = libm::exp(-0.5 * above * above) / libm::sqrt(core::f64::consts::TAU);
    1.0 - below - above * density + density * density / below
}

/// The bearing of a least-squares fit is Σ wᵢ sᵢ eᵢ / Σ wᵢ sᵢ², with the slopes sᵢ
/// of the gain: its variance for residuals with the autocorrelation that these have, up to where
/// that first vanishes, over its variance for independent ones.
fn correlated<A: Antenna>(fit: &Fit<'_, A>, offset: f64, residuals: &[f64]) -> f64 {
    let slopes = fit.slopes(offset);
    let weight: f64 = fit.variances.iter().map(|v| 1.0 / v).sum();
    let mean = slopes.iter().zip(&fit.variances).map(|(s, v)| s / v).sum::<f64>() / weight;
    let looks = fit.looks.looks.iter().zip(&fit.variances).zip(residuals).zip(&slopes);
    let mut looks: Vec<Residual> = looks
        .map(|(((look, variance), rest), slope)| {
            let sigma = libm::sqrt(*variance);
            let normal = rest / sigma;
            let slope = (slope - mean) / sigma;
            Residual { offset: look.offset, normal, slope }
        })
        .collect();
    let square: f64 = looks.iter().map(|look| look.normal * look.normal).sum();
    let own: f64 = looks.iter().map(|look| look.slope * look.slope).sum();
    looks.sort_unstable_by(|a, b| a.offset.total_cmp(&b.offset));
    let count = looks.len();
    // Around the circle: what follows the last look is the first, a turn on.
    looks.extend_from_within(..);
    looks[count..].iter_mut().for_each(|look| look.offset += TAU);
    // How many looks follow each one up to the present lag: pairs are visited lag by lag, since few
    // lags correlate.
    let mut reached: Vec<usize> = core::iter::repeat_n(1, count).collect();
    let mut sum = own;
    for lag in 1..=LAGS {
        let limit = (f64::from(lag) - BETWEEN) * (PI / f64::from(LAGS));
        let mut products = 0.0;
        let mut pairs = 0.0;
        let mut both = 0.0;
        for (first, reached) in reached.iter_mut().enumerate() {
            let look = &looks[first];
            for other in &looks[first + *reached..] {
                if other.offset - look.offset >= limit {
                    break;
                }
                products += look.normal * other.normal;
                pairs += 1.0;
                both += look.slope * other.slope;
                *reached += 1;
            }
        }
        if pairs < 1.0 {
            continue;
        }
        let correlation = products / pairs / (square / fit.looks.len());
        // Chance alone correlates by this much.
        if correlation < 1.0 / libm::sqrt(pairs) {
            break;
        }
        sum += 2.0 * correlation.min(1.0) * both;
    }
    (sum / own).max(1.0)
}

/// The reading of a posterior's peaks, or of the mean over the looks where there is no bearing.
fn read_out<A>(
    sweep: &Sweep<'_>,
    fit: &Fit<'_, A>,
    peaks: &[Peak],
    residual_db: f64,
    limits: &Limits,
) -> Reading {
    let (mean_dbm, spread_db) = fit.looks.spread();
    let level_alone = |reason| Reading {
        rss_dbm: mean_dbm,
        rss_sigma_db: libm::hypot(limits.rss_sigma_db, spread_db / libm::sqrt(fit.looks.len())),
        bearing: Err(reason),
        covariance: 0.0,
        modes: BearingModes::default(),
    };
    let measured = u16::try_from(fit.looks.looks.len()).unwrap_or(u16::MAX);
    if measured < limits.min_positions {
        return level_alone(NoBearing::TooSparse { measured, needed: limits.min_positions });
    }
    // Four numbers and fewer can always be met well enough.
    if measured > 4 && residual_db > spread_db {
        return level_alone(NoBearing::PoorFit { residual_db, flat_db: spread_db });
    }
    // Neither peaks nor numbers: the antenna or the readings are beyond reckoning.
    let sound = |peak: &Peak| peak.sigma.is_finite() && peak.offset.is_finite();
    if peaks.is_empty() || !peaks.iter().all(sound) {
        let sigma = f64::INFINITY;
        let limit = limits.max_sigma;
        return level_alone(NoBearing::TooWide { sigma, limit });
    }
    let mut directions = [BearingMode::default(); BearingModes::CAPACITY];
    let mut count = 0;
    let mut joint = Moments::default();
    for (mode, peak) in directions.iter_mut().zip(peaks) {
        let angle = angle::wrap(fit.looks.origin + peak.offset);
        *mode = BearingMode { weight: peak.weight, angle, sigma: peak.sigma.max(LEAST_SIGMA) };
        count += 1;
    }
    let modes = BearingModes::new(&directions[..count]).unwrap_or_default();
    let (angle, sigma) = if modes.is_empty() {
        (directions[0].angle, directions[0].sigma)
    } else if let Some(moments) = modes.moments() {
        moments
    } else {
        let resultant: Resultant = modes.as_slice().iter().map(|mode| mode.angle).collect();
        let reason = NoBearing::Ambiguous { resultant: resultant.length() };
        return Reading { modes, ..level_alone(reason) };
    };
    for (mode, peak) in directions[..count].iter().zip(peaks) {
        joint.add(peak, angle::wrap(mode.angle - angle));
    }
    let (level, level_variance, covariance) = joint.finish();
    if sigma > limits.max_sigma {
        let reason = NoBearing::TooWide { sigma, limit: limits.max_sigma };
        return Reading { modes, ..level_alone(reason) };
    }
    let confidence = Pattern::new(sweep, WINDOW).map_or(0.0, |p| resultant_confidence(&p));
    let rss_sigma_db = libm::hypot(limits.rss_sigma_db, libm::sqrt(level_variance));
    let bearing = Ok(Bearing { angle, sigma, confidence });
    Reading { rss_dbm: level, rss_sigma_db, bearing, covariance, modes }
}
