use alloc::vec::Vec;
use core::f64::consts::{FRAC_PI_4, TAU};

use foxhunt_core::{
    Bearing, BearingExtractor, BearingModes, NoBearing, NoReading, Reading, Sweep, angle,
    parameter::{ParameterError, positive},
};

use crate::extractor::{Pattern, likelihood::Looks, resultant_confidence};

/// The direction of the first harmonic of the turn: the vector sum of the boresights, each with the
/// power that was received along it, or with its level in dB about the mean.
///
/// Each boresight stands for its arc, half the way to either neighbour, so that what was not
/// received is interpolated. σ follows from the readings' scatter by the delta method, and from
/// the arcs that are too wide to be interpolated over. It does not know of reflections: only with
/// a known antenna can they be separated from a lobe. The level is the mean over the arcs in dB;
/// the confidence is [`resultant_confidence`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstHarmonic {
    decibels: bool,
    sample_sigma_db: f64,
    rss_sigma_db: f64,
    max_sigma: f64,
}

/// In linear power; readings of 2 dB where a turn does not show their scatter, a level's σ of 7.9
/// dB, bearings up to 1 rad of σ.
impl Default for FirstHarmonic {
    fn default() -> Self {
        Self { decibels: false, sample_sigma_db: 2.0, rss_sigma_db: 7.9, max_sigma: 1.0 }
    }
}

/// Fewer boresights have no harmonic.
const FEWEST: u16 = 3;

/// Number of assumed readings that a turn's scatter is pooled with.
const PRIOR_FREEDOM: f64 = 4.0;

/// ln 10 / 10: a dB's share of a power.
const PER_DB: f64 = core::f64::consts::LN_10 / 10.0;

impl FirstHarmonic {
    /// The first harmonic of the level in dB: the pattern's back counts as much as its main lobe.
    #[must_use]
    pub fn in_decibels() -> Self {
        Self { decibels: true, ..Self::default() }
    }

    /// Sets another standard deviation of the level, in dB.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_rss_sigma_db(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { rss_sigma_db: positive("rss_sigma_db", sigma)?, ..self })
    }

    /// Sets the largest standard deviation of bearings that are used, in radians.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_max_sigma(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { max_sigma: positive("max_sigma", sigma)?, ..self })
    }

    fn bearing(
        &self,
        looks: &Looks,
        around: &[Arc],
        level: f64,
        confidence: f64,
    ) -> Result<Bearing, NoBearing> {
        if around.len() < usize::from(FEWEST) {
            let measured = u16::try_from(around.len()).unwrap_or(0);
            return Err(NoBearing::TooSparse { measured, needed: FEWEST });
        }
        let top = around.iter().map(|arc| arc.mean_dbm).fold(f64::NEG_INFINITY, f64::max);
        let value = |arc: &Arc| {
            if self.decibels {
                arc.mean_dbm - level
            } else {
                libm::exp(PER_DB * (arc.mean_dbm - top))
            }
        };
        let mut cos = 0.0;
        let mut sin = 0.0;
        let mut total = 0.0;
        for arc in around {
            let weighted = arc.width * value(arc);
            cos += weighted * libm::cos(arc.offset);
            sin += weighted * libm::sin(arc.offset);
            total += weighted.abs();
        }
        let length = libm::hypot(cos, sin);
        if length <= 1e-9 * total.max(f64::MIN_POSITIVE) {
            return Err(NoBearing::Ambiguous { resultant: 0.0 });
        }
        let offset = libm::atan2(sin, cos);
        let noise = looks.sample_variance(self.sample_sigma_db, PRIOR_FREEDOM);
        let mut variance = 0.0;
        for arc in around {
            let across = arc.width * libm::sin(arc.offset - offset) / length;
            let per_db = if self.decibels { 1.0 } else { PER_DB * value(arc) };
            variance += across * across * per_db * per_db * noise / arc.count;
            // A straight line over a gap errs with its square; from 45° on it is a guess, and the
            // true value anything up to twice that.
            let gap = ((arc.width - arc.usual).max(0.0) / FRAC_PI_4).min(1.0);
            let guess = across * value(arc) * gap * gap;
            variance += guess * guess / 3.0;
        }
        let sigma = libm::sqrt(variance);
        if sigma > self.max_sigma {
            return Err(NoBearing::TooWide { sigma, limit: self.max_sigma });
        }
        let angle = angle::wrap(looks.origin + offset);
        Ok(Bearing { angle, sigma: sigma.max(1e-5), confidence })
    }
}

/// A boresight with the part of the circle that it stands for.
struct Arc {
    offset: f64,
    mean_dbm: f64,
    count: f64,
    width: f64,
    /// The width if all were alike.
    usual: f64,
}

fn arcs(looks: &Looks) -> Vec<Arc> {
    let mut around: Vec<Arc> = looks
        .looks
        .iter()
        .map(|look| Arc {
            offset: look.offset,
            mean_dbm: look.mean_dbm,
            count: look.count,
            width: 0.0,
            usual: TAU / looks.len(),
        })
        .collect();
    around.sort_by(|a, b| a.offset.total_cmp(&b.offset));
    let count = around.len();
    for i in 0..count {
        let to_next = around[(i + 1) % count].offset - around[i].offset;
        let gap = if i + 1 < count { to_next } else { to_next + TAU };
        around[i].width += 0.5 * gap;
        around[(i + 1) % count].width += 0.5 * gap;
    }
    around
}

impl BearingExtractor for FirstHarmonic {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let looks = Looks::new(sweep)?;
        let around = arcs(&looks);
        let level = around.iter().map(|arc| arc.width * arc.mean_dbm).sum::<f64>() / TAU;
        let confidence = Pattern::new(sweep, 1).map_or(0.0, |p| resultant_confidence(&p));
        Ok(Reading {
            rss_dbm: level,
            rss_sigma_db: self.rss_sigma_db,
            bearing: self.bearing(&looks, &around, level, confidence),
            covariance: 0.0,
            modes: BearingModes::default(),
        })
    }
}
