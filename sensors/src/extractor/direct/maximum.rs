use alloc::vec::Vec;

use foxhunt_core::{
    Bearing, BearingExtractor, BearingModes, NoBearing, NoReading, Reading, Sweep,
    angle::{self, Resultant},
    parameter::{ParameterError, positive},
};

use crate::extractor::{
    Pattern,
    likelihood::{Look, Looks},
    resultant_confidence,
    rounding::LEAST_RESULTANT,
};

/// The boresight whose readings are the strongest on average (Isaacs et al. 2014, §II).
///
/// Boresights that tie are averaged circularly. σ is the root mean square angle between the bearing
/// and the strongest twentieth of the boresights, at least four: under noise one of them might as
/// well have come out on top. The level is the mean over the measured positions; the confidence is
/// [`resultant_confidence`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Maximum {
    rss_sigma_db: f64,
}

/// A level's σ of 7.9 dB.
impl Default for Maximum {
    fn default() -> Self {
        Self { rss_sigma_db: 7.9 }
    }
}

/// σ comes from the strongest boresights: one in 20, and at least four.
const SHARE: usize = 20;
const FEWEST: usize = 4;

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
        if strongest.len() < FEWEST {
            let count = |number| u16::try_from(number).unwrap_or(u16::MAX);
            let measured = count(strongest.len());
            let needed = count(FEWEST);
            return Err(NoBearing::TooSparse { measured, needed });
        }
        strongest.sort_by(|a, b| b.mean_dbm.total_cmp(&a.mean_dbm));
        let count = (strongest.len() / SHARE).max(FEWEST);
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
