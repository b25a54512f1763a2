use foxhunt_core::{Estimate, Level, Quantity, Reception, Receptions, Remark, State};
use foxhunt_filters::{
    BatchError, BatchFix, Marginal, SlantRange, multilaterate, multilaterate_with_bias,
    range_bias_sigmas,
};
use foxhunt_sensors::{LogDistance, Propagation};
use nalgebra::Vector3;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{
    LocateConfig, LocateError, Located, Locator, RangeBias,
    located::{regions_with_rivals, rivals},
};

/// Locator by ranges: measured ranges, or ranges of levels by a known law of propagation
/// (`filters::multilaterate`); a silence is farther away than its floor would be.
#[derive(Clone, Copy, Debug)]
pub struct Multilateration;

impl Locator for Multilateration {
    fn locate(
        &self,
        receptions: &Receptions,
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let measured = |r: Reception| {
            let range = r.measured.get(Quantity::RANGE)?;
            let receiver = r.receiver.position;
            Some(SlantRange { receiver, range: range.value, sigma: range.sigma })
        };
        let mut ranges: Vec<SlantRange> = receptions.iter().filter_map(measured).collect();
        let mut beyond = Vec::new();
        let are_measured = !ranges.is_empty();
        if !are_measured {
            let Some((reference_dbm, exponent)) = config.power.law() else {
                return Err(LocateError::NoPower);
            };
            let law = LogDistance::new(reference_dbm, exponent)?;
            let count = receptions.iter().filter(|r| r.any_level().is_some()).count();
            // All ranges share the law's error: with a part of it each, their mean has all of it.
            let of_law = |range: f64| {
                let centroid = config.power.centroid()?;
                let count = u32::try_from(count).map_or(f64::INFINITY, f64::from);
                Some(centroid.sigma_db(range) * count.sqrt())
            };
            let range = |r: &Reception, level: Option<Level>| {
                Some(range_of(level?, r.receiver.position, &law, of_law))
            };
            ranges = receptions.iter().filter_map(|r| range(&r, r.level)).collect();
            beyond = receptions.iter().filter_map(|r| range(&r, r.silence)).collect();
        }
        if ranges.is_empty() {
            return Err(LocateError::NoLevels);
        }
        let observations = ranges.len() + beyond.len();
        let ranges = by_place(&ranges);
        let up = config.target_up_m;
        let alone = consistent_ranges(&ranges, up, |ranges| multilaterate(ranges, &beyond, up))?;
        let biased = if are_measured { with_bias(&ranges, up, &alone) } else { None };
        let located = match biased {
            Some(biased) if biased.is_taken => of_biased(&biased.solution),
            Some(Biased { solution, probability, .. }) => {
                let near = solution.mode_near(&alone.fix.estimate.mean);
                averaged(alone.located(), &near, probability)
            }
            None => alone.located(),
        };
        Ok(Located { observations, ..located })
    }
}

/// Returns one range for each place of a receiver, the mean of its own, as a wall or a detour
/// changes all of them alike.
fn by_place(ranges: &[SlantRange]) -> Vec<SlantRange> {
    let mut sorted: Vec<&SlantRange> = ranges.iter().collect();
    let key = |r: &SlantRange| (r.receiver.x, r.receiver.y, r.receiver.z);
    let order = |a: &(f64, f64, f64), b: &(f64, f64, f64)| {
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
    };
    sorted.sort_by(|a, b| order(&key(a), &key(b)));
    let mean = |of_place: &[&SlantRange]| {
        let weight = |r: &&SlantRange| 1.0 / (r.sigma * r.sigma);
        let total: f64 = of_place.iter().map(weight).sum();
        let sum: f64 = of_place.iter().map(|r| weight(r) * r.range).sum();
        let receiver = of_place.first()?.receiver;
        Some(SlantRange { receiver, range: sum / total, sigma: total.sqrt().recip() })
    };
    sorted.chunk_by(|a, b| key(a) == key(b)).filter_map(mean).collect()
}

/// Misfits less probable than this are more than their σ make.
const MISFIT_P: f64 = 0.05;

/// Misfits less probable than this may come from a bias that all ranges share.
const BIAS_P: f64 = 0.003;

/// Logarithm of the evidence that a bias has to gain before ranges are taken to share one.
const GAIN_OF_BIAS: f64 = 3.0;

/// Share of recordings of ranges whose ranges have a bias in common, as a prior.
const SHARE_OF_BIASED: f64 = 0.3;

/// Less probable explanations are left out of the average.
pub(super) const LEAST_PROBABILITY: f64 = 0.01;

/// Solution whose measurements scatter as their σ say, once these are widened by what is common to
/// no two of them.
pub(super) struct Consistent<const N: usize> {
    pub fix: BatchFix<N>,
    /// Probability of the misfit before the ranges are widened.
    p: f64,
    /// Factor on the covariance that the knowledge of the spread from few ranges is worth.
    pub factor: f64,
    /// Logarithm of the evidence by Laplace's method, under flat priors.
    pub log_evidence: f64,
}

impl Consistent<2> {
    pub(super) fn located(&self) -> Located {
        let mut fix = self.fix.clone();
        fix.estimate.covariance *= self.factor;
        fix.rival_estimates.iter_mut().for_each(|rival| rival.covariance *= self.factor);
        Located {
            rivals: rivals(&fix.rivals),
            regions_95: regions_with_rivals(&fix),
            ..Located::at(fix.estimate)
        }
    }
}

impl<const N: usize> Consistent<N> {
    /// Returns the place of the mode that is the nearest to a place: of two places alike, on either
    /// side of a line of receivers, the one on its own side.
    pub(super) fn mode_near(&self, place: &State<2>) -> Estimate<2> {
        let apart = |mode: &&Estimate<N>| (mode.mean.fixed_rows::<2>(0) - place).norm_squared();
        let rivals = self.fix.rival_estimates.iter();
        let nearest = rivals.min_by(|a, b| apart(a).total_cmp(&apart(b)));
        let own = &self.fix.estimate;
        let mode = nearest.filter(|rival| apart(rival) < apart(&own)).unwrap_or(own);
        Estimate {
            mean: mode.mean.fixed_rows::<2>(0).into_owned(),
            covariance: mode.covariance.fixed_view::<2, 2>(0, 0) * self.factor,
        }
    }
}

/// Solves again with σ² + τ², τ² such that the misfit is what is expected of the measurements
/// (Paule & Mandel 1982), where the misfit is improbable under their σ alone. `solve` takes τ²,
/// and `residuals` returns the residual and the σ² of each measurement.
pub(super) fn consistent<const N: usize, E>(
    solve: impl Fn(f64) -> Result<BatchFix<N>, E>,
    residuals: impl Fn(&State<N>) -> Vec<(f64, f64)>,
) -> Result<Consistent<N>, E> {
    let mut fix = solve(0.0)?;
    let mut squares = squared(&residuals(&fix.estimate.mean));
    let degrees = u32::try_from(squares.len().saturating_sub(N)).unwrap_or(u32::MAX);
    let degrees = f64::from(degrees.max(1));
    let misfit: f64 = squares.iter().map(|(square, own)| square / own).sum();
    let p = ChiSquared::new(degrees).map_or(1.0, |law| law.sf(misfit));
    let mut spread = 0.0;
    let mut factor = 1.0;
    for _ in 0..20 {
        let next = if p < MISFIT_P { spread_of(&squares, degrees) } else { 0.0 };
        let settled = (next - spread).abs() <= 1e-3 * next;
        spread = next;
        if spread > 0.0 {
            fix = solve(spread)?;
            squares = squared(&residuals(&fix.estimate.mean));
            // The variance of Student's t.
            factor = degrees / (degrees - 2.0).max(0.5);
        }
        if settled {
            break;
        }
    }
    let normal = |(square, own): &(f64, f64)| {
        let variance = own + spread;
        -0.5 * (libm::log(std::f64::consts::TAU * variance) + square / variance)
    };
    let root = fix.estimate.covariance.cholesky().map(|factor| factor.l_dirty().diagonal());
    let log_root = root.map_or(0.0, |root| root.map(libm::log).sum());
    let unknowns = f64::from(u32::try_from(N).unwrap_or(u32::MAX));
    let volume = log_root + 0.5 * unknowns * libm::log(std::f64::consts::TAU);
    let log_evidence = squares.iter().map(normal).sum::<f64>() + volume;
    Ok(Consistent { fix, p, factor, log_evidence })
}

fn squared(residuals: &[(f64, f64)]) -> Vec<(f64, f64)> {
    residuals.iter().map(|(residual, own)| (residual * residual, *own)).collect()
}

/// Solves ranges to a target at the height `up` by `solve`, as [`consistent`] has it.
fn consistent_ranges<const N: usize>(
    ranges: &[SlantRange],
    up: f64,
    solve: impl Fn(&[SlantRange]) -> Result<BatchFix<N>, BatchError>,
) -> Result<Consistent<N>, BatchError> {
    let widened = |spread: f64| {
        let widen = |r: &SlantRange| SlantRange { sigma: (r.sigma.powi(2) + spread).sqrt(), ..*r };
        solve(&ranges.iter().map(widen).collect::<Vec<_>>())
    };
    let residuals = |mean: &State<N>| {
        let place = mean.fixed_rows::<2>(0).into_owned();
        let offset = mean.get(2).copied().unwrap_or(0.0);
        let scale = mean.get(3).copied().unwrap_or(0.0);
        let residual = |r: &SlantRange| {
            let expected = (1.0 + scale) * (place.push(up) - r.receiver).norm() + offset;
            (r.range - expected, r.sigma * r.sigma)
        };
        ranges.iter().map(residual).collect()
    };
    consistent(widened, residuals)
}

/// Returns the variance that makes the misfit what is expected, from squared residuals and their
/// variances.
fn spread_of(squares: &[(f64, f64)], degrees: f64) -> f64 {
    let misfit =
        |spread: f64| squares.iter().map(|(square, own)| square / (own + spread)).sum::<f64>();
    let sum: f64 = squares.iter().map(|(square, _)| square).sum();
    let mut bounds = (0.0, sum / degrees.max(1.0));
    for _ in 0..60 {
        let middle = 0.5 * (bounds.0 + bounds.1);
        bounds = if misfit(middle) > degrees { (middle, bounds.1) } else { (bounds.0, middle) };
    }
    bounds.1
}

/// Solution with an offset and a scale that all ranges share.
struct Biased {
    solution: Consistent<4>,
    /// True if it explains the ranges far better, so that it stands alone.
    is_taken: bool,
    /// Its probability beside the solution without them.
    probability: f64,
}

/// Returns the solution with an offset and a scale that all ranges share; `None` where it is not
/// determined or improbable.
fn with_bias(ranges: &[SlantRange], up: f64, alone: &Consistent<2>) -> Option<Biased> {
    let solution =
        consistent_ranges(ranges, up, |ranges| multilaterate_with_bias(ranges, up)).ok()?;
    let Estimate { mean, covariance } = &solution.fix.estimate;
    let [offset_sigma, scale_sigma] = range_bias_sigmas(ranges);
    // A place that is open to the prior has no evidence by Laplace's method.
    let open_m = offset_sigma / scale_sigma;
    if covariance.fixed_view::<2, 2>(0, 0).trace() > open_m * open_m {
        return None;
    }
    let prior = |value: f64, sigma: f64| {
        -0.5 * libm::log(std::f64::consts::TAU * sigma * sigma) - 0.5 * (value / sigma).powi(2)
    };
    let of_bias = prior(mean.z, offset_sigma) + prior(mean.w, scale_sigma);
    let gain = solution.log_evidence + of_bias - alone.log_evidence;
    let probability = posterior(SHARE_OF_BIASED, gain);
    let is_taken = alone.p <= BIAS_P && gain > GAIN_OF_BIAS;
    let counts = is_taken || probability > LEAST_PROBABILITY;
    counts.then_some(Biased { solution, is_taken, probability })
}

/// Takes another explanation into account, with its probability: few measurements may fit the
/// first, and come from a place far off all the same. The place is that of the more probable one,
/// the covariance that of both about it.
pub(super) fn averaged(first: Located, second: &Estimate<2>, probability: f64) -> Located {
    let apart = second.mean - first.estimate.mean;
    let is_first = probability <= 0.5;
    let other = if is_first { probability } else { 1.0 - probability };
    let mean = if is_first { first.estimate.mean } else { second.mean };
    let covariance = first.estimate.covariance * (1.0 - probability)
        + second.covariance * probability
        + apart * apart.transpose() * other;
    Located { estimate: Estimate { mean, covariance }, ..first }
}

/// Probability of an explanation whose evidence is exp(`gain`) times that of another one, for its
/// prior probability `prior`.
pub(super) fn posterior(prior: f64, gain: f64) -> f64 {
    1.0 / (1.0 + (1.0 - prior) / prior * libm::exp(-gain))
}

fn of_biased(biased: &Consistent<4>) -> Located {
    let Estimate { mean, covariance } = &biased.fix.estimate;
    let covariance = covariance * biased.factor;
    let place =
        Estimate { mean: mean.xy(), covariance: covariance.fixed_view::<2, 2>(0, 0).into_owned() };
    let offset_m = Marginal { mean: mean.z, sd: covariance[(2, 2)].sqrt() };
    let scale = Marginal { mean: 1.0 + mean.w, sd: covariance[(3, 3)].sqrt() };
    let text = format!(
        "the ranges meet if all of them have the same bias, {:+.2} m (σ {:.2} m) and a scale of \
         {:.3} (σ {:.3}), and that is taken off; calibrate the ranging, or check the places of the \
         receivers",
        offset_m.mean, offset_m.sd, scale.mean, scale.sd
    );
    Located {
        rivals: rivals(&biased.fix.rivals),
        range_bias: Some(RangeBias { offset_m, scale }),
        remarks: vec![Remark::new("ranges-share-bias", text)],
        ..Located::at(place)
    }
}

/// The range at which a law has a level; its σ to first order.
fn range_of(
    level: Level,
    receiver: Vector3<f64>,
    law: &LogDistance,
    of_law: impl Fn(f64) -> Option<f64>,
) -> SlantRange {
    let decades = (law.rss_dbm(1.0) - level.rss_dbm) / (10.0 * law.exponent());
    let range = libm::pow(10.0_f64, decades);
    let sigma_db = libm::hypot(level.sigma_db, of_law(range).unwrap_or(0.0));
    let sigma = range * sigma_db * std::f64::consts::LN_10 / (10.0 * law.exponent());
    SlantRange { receiver, range, sigma }
}
