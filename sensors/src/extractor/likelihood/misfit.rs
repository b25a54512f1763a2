use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use super::fit::Fit;
use crate::Antenna;

/// Comparison of a fit's residuals with the looks' variances.
#[derive(Clone, Copy, Debug)]
pub(super) struct Misfit {
    /// The root mean square of the residuals, in dB.
    pub(super) residual_db: f64,
    /// The mean square over the promised one, if that is more: the factor by which all variances
    /// are too small.
    pub(super) scale: f64,
    /// Loss by neighbours erring alike: the variance of the bearing over that with independent
    /// residuals.
    pub(super) correlation: f64,
}

/// Lags are counted in classes of 5°, up to short of half a turn: beyond it a pair is met from its
/// other look.
const LAGS: u16 = 36;

/// Their limits lie where the steps of no usual turn do, so that rounding moves no lag across one.
const BETWEEN: f64 = 0.37;

/// Fewer looks than this do not show correlation.
const FEWEST: f64 = 16.0;

/// Residuals with less than this share of the promised mean square come from a turn without noise,
/// in which nothing but rounding correlates.
const NOTHING: f64 = 0.01;

impl Misfit {
    /// Compares the residuals at a bearing, with `fitted` unknowns fitted.
    pub(super) fn new<A: Antenna>(
        fit: &Fit<'_, A>,
        offset: f64,
        residuals: &[f64],
        fitted: f64,
    ) -> Self {
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
    pub(super) fn inflation(&self) -> f64 {
        self.scale * self.correlation
    }
}

/// Number of residuals of the promised size that are added.
const PROMISED: f64 = 4.0;

/// A look's residual and its slope about the mean one, over σ.
#[derive(Clone, Copy)]
struct Residual {
    offset: f64,
    normal: f64,
    slope: f64,
}

/// The bearing of a least-squares fit is Σ wᵢ sᵢ eᵢ / Σ wᵢ sᵢ², with the slopes sᵢ of the gain: its
/// variance for residuals with the autocorrelation that these have, up to where that first
/// vanishes, over its variance for independent ones.
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
