//! Transmitters that send at once on one frequency: a turn over the sum of their powers.

use alloc::vec::Vec;

use foxhunt_core::BearingModes;
use nalgebra::{SMatrix, SVector};

use super::{
    super::{NODES, Peak, Posterior, node_offset, summit},
    Fit, Misfit, PROMISED,
    judge::{Judged, gaussian, gaussian_nodes},
};
use crate::Antenna;

/// Largest number of transmitters of a turn.
const MOST: usize = BearingModes::CAPACITY;

/// Level and direction of each.
const UNKNOWNS: usize = 2 * MOST;

/// Every second node is tried for one transmitter more.
const STRIDE: u16 = 2;

/// Levels that are tried for one more, in dB below the strongest.
const BELOW_DB: [f64; 5] = [0.0, 4.0, 8.0, 12.0, 16.0];

/// Fall of χ² that one more has to bring, beside 2 ln n for its two unknowns (Schwarz 1978): there
/// are some twenty places for it that a lobe tells apart.
const SOMEWHERE: f64 = 6.0;

/// Looks that have to be left over.
const SPARE: f64 = 4.0;

/// A direction with a larger σ is no direction, in radians.
const NO_DIRECTION: f64 = 0.5;

/// Steps of Levenberg and Marquardt.
const STEPS: u32 = 30;

/// A transmitter: its direction, counted like the looks', and its level in dBm.
#[derive(Clone, Copy, Debug)]
struct Source {
    offset: f64,
    level: f64,
}

/// Transmitters that were fitted together.
#[derive(Clone, Debug)]
struct Sum {
    sources: Vec<Source>,
    chi_squared: f64,
    residuals: Vec<f64>,
    /// The normal equations: JᵀWJ and JᵀWr, level and direction of each in turn; the identity where
    /// there is no transmitter.
    matrix: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    gradient: SVector<f64, UNKNOWNS>,
}

impl Sum {
    /// Number of its unknowns, as a number to reckon with.
    fn unknowns(&self) -> f64 {
        self.sources.iter().map(|_| 2.0).sum()
    }
}

/// The reading of a turn as the sum of the powers of up to four transmitters, as many as the turn
/// warrants. Each peak's weight is its share of the power, and its level that of the sum. A turn
/// that warrants one is judged as Gaussian residuals are, without the directions that compete for
/// it: each peak here is a transmitter of its own.
pub(super) fn superposed<A: Antenna>(fit: &Fit<'_, A>) -> Judged {
    let (offset, level) = summit(&gaussian_nodes(fit, 1.0));
    let mut sum = fitted(fit, alloc::vec![Source { offset, level }]);
    let mut several = None;
    while sum.sources.len() < MOST {
        let Some((more, judged)) = one_more(fit, &sum) else { break };
        sum = more;
        several = Some(judged);
    }
    several.unwrap_or_else(|| alone(gaussian(fit)))
}

/// A judgement with its most probable direction alone.
fn alone(mut judged: Judged) -> Judged {
    let peaks = &mut judged.posterior.peaks;
    peaks.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    peaks.truncate(1);
    peaks.iter_mut().for_each(|peak| peak.weight = 1.0);
    judged
}

/// The judgement of a sum; `None` where the direction of one of its transmitters is not known.
fn judged<A: Antenna>(fit: &Fit<'_, A>, sum: &Sum) -> Option<Judged> {
    let strongest = sum.sources.iter().max_by(|a, b| a.level.total_cmp(&b.level));
    let offset = strongest.map_or(0.0, |source| source.offset);
    let misfit = Misfit::new(fit, offset, &sum.residuals, sum.unknowns());
    let inflation = misfit.inflation();
    let posterior = Posterior { log_mass: 0.0, peaks: peaks(sum, inflation)? };
    Some(Judged { posterior, residual_db: misfit.residual_db, inflation })
}

/// The transmitters and one more with their judgement, if the turn warrants that.
fn one_more<A: Antenna>(fit: &Fit<'_, A>, sum: &Sum) -> Option<(Sum, Judged)> {
    let count = fit.looks.len();
    let freedom = count - sum.unknowns() - 2.0;
    if freedom < SPARE {
        return None;
    }
    let mut sources = sum.sources.clone();
    sources.push(start(fit, sum)?);
    let more = fitted(fit, sources);
    let scale = ((more.chi_squared + PROMISED) / (freedom + PROMISED)).max(1.0);
    let warranted =
        sum.chi_squared - more.chi_squared > scale * (2.0 * libm::log(count) + SOMEWHERE);
    let judged = judged(fit, &more).filter(|_| warranted)?;
    Some((more, judged))
}

/// The place for one more at which the residuals are least.
fn start<A: Antenna>(fit: &Fit<'_, A>, sum: &Sum) -> Option<Source> {
    let strongest = sum.sources.iter().map(|source| source.level).fold(f64::MIN, f64::max);
    let looks = fit.looks.looks.iter().zip(&sum.residuals);
    let present: Vec<f64> = looks.map(|(look, residual)| power(look.mean_dbm - residual)).collect();
    let mut gains = Vec::new();
    let mut best: Option<(f64, Source)> = None;
    for offset in (0..NODES / STRIDE).map(|node| node_offset(node * STRIDE)) {
        fit.gains(offset, &mut gains);
        gains.iter_mut().for_each(|gain| *gain = power(*gain));
        for level in BELOW_DB.map(|below| strongest - below) {
            let strength = power(level);
            let looks = fit.looks.looks.iter().zip(&fit.variances).zip(&present).zip(&gains);
            let squares = looks.map(|(((look, variance), present), gain)| {
                let residual = look.mean_dbm - decibels(present + strength * gain);
                residual * residual / variance
            });
            let cost: f64 = squares.sum();
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, Source { offset, level }));
            }
        }
    }
    best.map(|(_, source)| source)
}

/// The least squares of residuals in dB from these on (Marquardt 1963).
fn fitted<A: Antenna>(fit: &Fit<'_, A>, sources: Vec<Source>) -> Sum {
    let mut best = laid(fit, sources);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let mut matrix = best.matrix;
        matrix.set_diagonal(&(matrix.diagonal() * (1.0 + damping)));
        let Some(factor) = matrix.cholesky() else { break };
        let step = factor.solve(&best.gradient);
        let moved = best.sources.iter().enumerate().map(|(i, source)| Source {
            level: source.level + step[2 * i],
            offset: source.offset + step[2 * i + 1].clamp(-0.3, 0.3),
        });
        let next = laid(fit, moved.collect());
        if next.chi_squared < best.chi_squared {
            let settled = best.chi_squared - next.chi_squared < 1e-6;
            best = next;
            damping = (damping * 0.3).max(1e-9);
            if settled {
                break;
            }
        } else {
            damping *= 5.0;
            if damping > 1e6 {
                break;
            }
        }
    }
    best
}

/// Transmitters laid against the turn.
fn laid<A: Antenna>(fit: &Fit<'_, A>, sources: Vec<Source>) -> Sum {
    let mut powers: Vec<Vec<f64>> = Vec::new();
    let mut slopes: Vec<Vec<f64>> = Vec::new();
    for source in &sources {
        let mut gains = Vec::new();
        fit.gains(source.offset, &mut gains);
        powers.push(gains.iter().map(|gain| power(source.level + gain)).collect());
        slopes.push(fit.slopes(source.offset));
    }
    let mut matrix = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
    let mut gradient = SVector::<f64, UNKNOWNS>::zeros();
    let mut chi_squared = 0.0;
    let mut residuals = Vec::with_capacity(fit.looks.looks.len());
    for (row, (look, variance)) in fit.looks.looks.iter().zip(&fit.variances).enumerate() {
        let total: f64 = powers.iter().map(|powers| powers[row]).sum();
        let residual = look.mean_dbm - decibels(total);
        let mut slope = SVector::<f64, UNKNOWNS>::zeros();
        for (i, (powers, slopes)) in powers.iter().zip(&slopes).enumerate() {
            let share = powers[row] / total;
            slope[2 * i] = share;
            slope[2 * i + 1] = share * slopes[row];
        }
        matrix += slope * slope.transpose() / *variance;
        gradient += slope * (residual / variance);
        chi_squared += residual * residual / variance;
        residuals.push(residual);
    }
    for unused in 2 * sources.len()..UNKNOWNS {
        matrix[(unused, unused)] = 1.0;
    }
    Sum { sources, chi_squared, residuals, matrix, gradient }
}

/// Their directions with the covariance of the fit; `None` where one of them is not known.
fn peaks(sum: &Sum, inflation: f64) -> Option<Vec<Peak>> {
    let factor = sum.matrix.cholesky()?;
    let total: f64 = sum.sources.iter().map(|source| power(source.level)).sum();
    // The level of the sum goes with each level by its share.
    let mut shares = SVector::<f64, UNKNOWNS>::zeros();
    for (i, source) in sum.sources.iter().enumerate() {
        shares[2 * i] = power(source.level) / total;
    }
    let of_level = factor.solve(&shares) * inflation;
    let peak = |(i, source): (usize, &Source)| {
        let mut unit = SVector::<f64, UNKNOWNS>::zeros();
        unit[2 * i + 1] = 1.0;
        let variance = factor.solve(&unit)[2 * i + 1] * inflation;
        Peak {
            weight: shares[2 * i],
            offset: source.offset,
            sigma: libm::sqrt(variance),
            level: decibels(total),
            level_variance: shares.dot(&of_level),
            covariance: of_level[2 * i + 1],
        }
    };
    let peaks: Vec<Peak> = sum.sources.iter().enumerate().map(peak).collect();
    // Neither is known where they may be in each other's place.
    peaks.iter().all(|peak| peak.sigma < NO_DIRECTION).then_some(peaks)
}

fn power(decibels: f64) -> f64 {
    libm::exp10(0.1 * decibels)
}

fn decibels(power: f64) -> f64 {
    10.0 * libm::log10(power)
}
