use foxhunt_core::{
    Bearing, BearingMode, BearingModes, NoBearing, Reading, Sweep,
    angle::{self, Resultant},
};

use super::{fit::Fit, posterior::Peak};
use crate::extractor::{Pattern, resultant_confidence};

/// Limits that a fit must keep to be a bearing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    pub(super) rss_sigma_db: f64,
    /// Largest σ of a bearing, in radians.
    pub(super) max_sigma: f64,
    pub(super) min_positions: u16,
}

impl Default for Limits {
    fn default() -> Self {
        Self { rss_sigma_db: 7.9, max_sigma: 1.0, min_positions: 8 }
    }
}

/// Least σ of a bearing, in radians: half a thousandth of a degree, so that no observation has a σ
/// of zero.
const LEAST_SIGMA: f64 = 1e-5;

/// The reading of a posterior's peaks, or of the mean over the looks where there is no bearing.
pub(super) fn read_out<A>(
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

/// The moving mean's window for the confidence, that of the reference extractor.
const WINDOW: u16 = 7;

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
