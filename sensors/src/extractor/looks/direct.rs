//! Bearings read off a turn by an antenna of which no more is known than that it has a main lobe.

use alloc::vec::Vec;
use core::f64::consts::{FRAC_PI_4, TAU};

use foxhunt_core::{
    Bearing, BearingExtractor, BearingModes, NoBearing, NoReading, Reading, Sample, Sweep,
    angle::{self, Resultant},
    parameter::{ParameterError, positive, require},
};
use nalgebra::{Matrix3, Vector3};

use super::{Look, Looks};
use crate::extractor::{Cell, Pattern, pattern::LEAST_RESULTANT, resultant_confidence};

/// σ comes from the strongest boresights: one in 20, and at least four.
const SHARE: usize = 20;
const FEWEST_STRONGEST: usize = 4;

/// Fewer boresights have no harmonic.
const FEWEST_ARCS: u16 = 3;

/// Number of assumed readings that a turn's scatter is pooled with.
const PRIOR_FREEDOM: f64 = 4.0;

/// ln 10 / 10: a dB's share of a power.
const PER_DB: f64 = core::f64::consts::LN_10 / 10.0;

/// A parabola goes through any three.
const FEWEST_NEAR: u16 = 4;

/// The moving mean that the maximum is sought in.
const WINDOW: u16 = 7;

/// The boresight whose readings are the strongest on average (Isaacs et al. 2014, §II).
///
/// Boresights that tie are averaged circularly. σ is the root mean square angle between the
/// bearing and the strongest twentieth of the boresights, at least four: under noise one of them
/// might as well have come out on top. The level is the mean over the measured positions; the
/// confidence is [`resultant_confidence`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Maximum {
    rss_sigma_db: f64,
}

/// A level's σ of 7.9 dB.
impl Default for Maximum {
    fn default() -> Self {
        Self { rss_sigma_db: Reading::RSS_SIGMA_DB }
    }
}

impl Maximum {
    /// Sets another standard deviation of the level, in dB.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_rss_sigma_db(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { rss_sigma_db: positive("rss_sigma_db", sigma)? })
    }

    fn bearing(&self, looks: &Looks, step: f64, confidence: f64) -> Result<Bearing, NoBearing> {
        let mut strongest: Vec<&Look> = looks.looks.iter().collect();
        if strongest.len() < FEWEST_STRONGEST {
            let count = |number| u16::try_from(number).unwrap_or(u16::MAX);
            let measured = count(strongest.len());
            let needed = count(FEWEST_STRONGEST);
            return Err(NoBearing::TooSparse { measured, needed });
        }
        strongest.sort_by(|a, b| b.mean_dbm.total_cmp(&a.mean_dbm));
        let count = (strongest.len() / SHARE).max(FEWEST_STRONGEST);
        let level = |rank: usize| strongest.get(rank).map_or(0.0, |look| look.mean_dbm);
        // Sums in another order differ by less than this, in dB.
        let above = |level: f64| strongest.iter().take_while(move |l| l.mean_dbm > level - 1e-9);
        let tied: Resultant = above(level(0)).map(|look| look.offset).collect();
        let Some(offset) = tied.direction(LEAST_RESULTANT) else {
            return Err(NoBearing::Ambiguous { resultant: tied.length() });
        };
        let mut squares = 0.0;
        let mut near = 0.0;
        for look in above(level(count - 1)) {
            let off = angle::distance(look.offset, offset);
            squares += off * off;
            near += 1.0;
        }
        // One of a turn's positions is known no better than by its own width.
        let sigma = libm::sqrt(squares / near + step * step / 12.0);
        Ok(Bearing { angle: angle::wrap(looks.origin + offset), sigma, confidence })
    }
}

impl BearingExtractor for Maximum {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let pattern = Pattern::new(sweep, 1)?;
        let step = core::f64::consts::TAU / f64::from(sweep.positions);
        let confidence = resultant_confidence(&pattern);
        Ok(Reading {
            rss_dbm: pattern.rss_dbm(),
            rss_sigma_db: self.rss_sigma_db,
            bearing: self.bearing(&Looks::new(sweep)?, step, confidence),
            covariance: 0.0,
            modes: BearingModes::default(),
        })
    }
}

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
        Self {
            decibels: false,
            sample_sigma_db: Sample::SIGMA_DB,
            rss_sigma_db: Reading::RSS_SIGMA_DB,
            max_sigma: 1.0,
        }
    }
}

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
        if around.len() < usize::from(FEWEST_ARCS) {
            let measured = u16::try_from(around.len()).unwrap_or(0);
            return Err(NoBearing::TooSparse { measured, needed: FEWEST_ARCS });
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

/// The top of the parabola in dB that fits the readings about the maximum best: a lobe that is
/// Gaussian in power is one.
///
/// The parabola is laid by least squares about the maximum of the moving mean, then once more about
/// its own top. σ is that of the regression, from the readings' scatter or from its residuals,
/// whichever is larger. A lobe that a second path distorts stays a parabola: σ does not know of
/// it. The level is the mean over the measured positions; the confidence is
/// [`resultant_confidence`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MainLobeFit {
    half_width: f64,
    sample_sigma_db: f64,
    rss_sigma_db: f64,
    max_sigma: f64,
}

/// 40° to either side: the main lobe of a patch to 4 dB below its top; readings of 2 dB where a
/// turn does not show their scatter, a level's σ of 7.9 dB, bearings up to 1 rad of σ.
impl Default for MainLobeFit {
    fn default() -> Self {
        let half_width = 40.0_f64.to_radians();
        Self {
            half_width,
            sample_sigma_db: Sample::SIGMA_DB,
            rss_sigma_db: Reading::RSS_SIGMA_DB,
            max_sigma: 1.0,
        }
    }
}

impl MainLobeFit {
    /// Sets the half-width of the parabola, in radians.
    ///
    /// # Errors
    ///
    /// If it is not between 0 and half a turn.
    pub fn with_half_width(self, half_width: f64) -> Result<Self, ParameterError> {
        let holds = half_width > 0.0 && half_width < core::f64::consts::PI;
        let half_width = require(holds, "half_width", half_width, "between 0 and π")?;
        Ok(Self { half_width, ..self })
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

    fn bearing(&self, looks: &Looks, pattern: &Pattern) -> Result<Bearing, NoBearing> {
        let maximum =
            pattern.cells().iter().filter_map(Cell::smoothed_dbm).fold(f64::NEG_INFINITY, f64::max);
        let strongest = |cell: &&Cell| cell.smoothed_dbm().is_some_and(|dbm| dbm > maximum - 1e-9);
        let strongest: Resultant =
            pattern.cells().iter().filter(strongest).map(Cell::angle).collect();
        let Some(angle) = strongest.direction(LEAST_RESULTANT) else {
            return Err(NoBearing::Ambiguous { resultant: strongest.length() });
        };
        let noise = looks.sample_variance(self.sample_sigma_db, PRIOR_FREEDOM);
        let first = self.parabola(looks, angle::wrap(angle - looks.origin), noise)?;
        let (offset, sigma) = self.parabola(looks, first.0, noise)?;
        if sigma > self.max_sigma {
            return Err(NoBearing::TooWide { sigma, limit: self.max_sigma });
        }
        let angle = angle::wrap(looks.origin + offset);
        Ok(Bearing { angle, sigma: sigma.max(1e-5), confidence: resultant_confidence(pattern) })
    }

    /// The top of the parabola about `center`, and its σ.
    fn parabola(&self, looks: &Looks, center: f64, noise: f64) -> Result<(f64, f64), NoBearing> {
        let near = || {
            looks.looks.iter().filter_map(|look| {
                let off = angle::wrap(look.offset - center);
                (off.abs() <= self.half_width).then_some((off, look))
            })
        };
        let mut normal = Matrix3::zeros();
        let mut pull = Vector3::zeros();
        let mut measured = 0_u16;
        let reference = near().map(|(_, look)| look.mean_dbm).fold(f64::NEG_INFINITY, f64::max);
        for (off, look) in near() {
            let row = Vector3::new(1.0, off, off * off);
            normal += look.count * row * row.transpose();
            pull += look.count * (look.mean_dbm - reference) * row;
            measured = measured.saturating_add(1);
        }
        let sparse = NoBearing::TooSparse { measured, needed: FEWEST_NEAR };
        if measured < FEWEST_NEAR {
            return Err(sparse);
        }
        let factor = normal.cholesky().ok_or(sparse)?;
        let fitted = factor.solve(&pull);
        let slope = fitted.y;
        let bend = fitted.z;
        let top = -0.5 * slope / bend;
        let flat = NoBearing::TooWide { sigma: core::f64::consts::PI, limit: self.max_sigma };
        // No lobe, or one whose top is elsewhere.
        if !(bend < 0.0 && top.abs() <= self.half_width) {
            return Err(flat);
        }
        let square = |(off, look): (f64, &Look)| {
            let rest = look.mean_dbm - reference - fitted.dot(&Vector3::new(1.0, off, off * off));
            look.count * rest * rest
        };
        let left = f64::from(measured) - 3.0;
        let scale = near().map(square).sum::<f64>() / left;
        // ∂top/∂(slope, bend).
        let gradient = Vector3::new(0.0, -0.5 / bend, 0.5 * slope / (bend * bend));
        let variance = gradient.dot(&factor.solve(&gradient)) * scale.max(noise);
        Ok((center + top, libm::sqrt(variance)))
    }
}

impl BearingExtractor for MainLobeFit {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let pattern = Pattern::new(sweep, WINDOW)?;
        let looks = Looks::new(sweep)?;
        Ok(Reading {
            rss_dbm: pattern.rss_dbm(),
            rss_sigma_db: self.rss_sigma_db,
            bearing: self.bearing(&looks, &pattern),
            covariance: 0.0,
            modes: BearingModes::default(),
        })
    }
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
