use foxhunt_core::{
    Bearing, BearingExtractor, BearingModes, NoBearing, NoReading, Reading, Sweep,
    angle::{self, Resultant},
    parameter::{ParameterError, not_negative, positive, require},
};

use super::{Cell, Pattern, pattern::LEAST_RESULTANT, resultant_confidence};

/// The reference extractor (Pritzl 2018, §4.1–4.2): the level is the mean over the turn, the
/// bearing the angle of the moving mean's maximum, its σ the reach of the lobe about it.
///
/// Positions that tie for the maximum are averaged circularly. σ is the largest angle between the
/// bearing and any position within [`width_db`](Self::with_width_db) of the maximum, connected with
/// it or not. The confidence is [`resultant_confidence`].
///
/// Two guards are not in the source, which would give 0.147 rad for a turn with one measured
/// position: a least number of measured positions, and a floor under σ.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Fields", into = "Fields"))]
pub struct Pritzl2018 {
    window: u16,
    rss_sigma_db: f64,
    width_db: f64,
    max_sigma: f64,
    min_sigma: f64,
    min_positions: u16,
}

/// A window of 7 positions, σRSS 7.9 dB, a width of 2 dB and bearings up to 3 rad as in the source;
/// σθ from 0.05 rad on (one of 128 positions) and from 16 measured positions on.
impl Default for Pritzl2018 {
    fn default() -> Self {
        Self {
            window: 7,
            rss_sigma_db: Reading::RSS_SIGMA_DB,
            width_db: 2.0,
            max_sigma: 3.0,
            min_sigma: 0.05,
            min_positions: 16,
        }
    }
}

impl Pritzl2018 {
    /// Sets a moving mean over `positions`, an odd number of them.
    ///
    /// # Errors
    ///
    /// If the number is even or above the pattern's capacity.
    pub fn with_window(self, positions: u16) -> Result<Self, ParameterError> {
        let valid = positions % 2 == 1 && positions <= Pattern::CAPACITY;
        require(valid, "window", positions.into(), "odd and at most 360")?;
        Ok(Self { window: positions, ..self })
    }

    /// Sets another standard deviation of the level, in dB.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_rss_sigma_db(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { rss_sigma_db: positive("rss_sigma_db", sigma)?, ..self })
    }

    /// Sets the fall in dB at which the bearing's σ is taken.
    ///
    /// # Errors
    ///
    /// If it is negative or not finite.
    pub fn with_width_db(self, width: f64) -> Result<Self, ParameterError> {
        Ok(Self { width_db: not_negative("width_db", width)?, ..self })
    }

    /// Sets the greatest standard deviation of a bearing, in radians.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_max_sigma(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { max_sigma: positive("max_sigma", sigma)?, ..self })
    }

    /// Sets the least standard deviation of a bearing, in radians.
    ///
    /// # Errors
    ///
    /// If it is negative or not finite. At 0 a pattern with a single position on top has the
    /// σ of 0, which no [`Observation`](foxhunt_core::Observation) takes.
    pub fn with_min_sigma(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { min_sigma: not_negative("min_sigma", sigma)?, ..self })
    }

    /// Sets the minimum number of positions for a bearing.
    ///
    /// # Errors
    ///
    /// If it is 0 or above the pattern's capacity.
    pub fn with_min_positions(self, positions: u16) -> Result<Self, ParameterError> {
        let valid = (1..=Pattern::CAPACITY).contains(&positions);
        require(valid, "min_positions", positions.into(), "1 to 360")?;
        Ok(Self { min_positions: positions, ..self })
    }

    /// A sweep as this extractor puts it in order, to look at.
    ///
    /// # Errors
    ///
    /// The errors of [`Pattern::new`].
    pub fn pattern(&self, sweep: &Sweep<'_>) -> Result<Pattern, NoReading> {
        Pattern::new(sweep, self.window)
    }

    /// The bearing in a pattern.
    ///
    /// # Errors
    ///
    /// [`NoBearing`] when too little was received, the strongest positions cancel, or the lobe is
    /// too wide.
    pub fn bearing(&self, pattern: &Pattern) -> Result<Bearing, NoBearing> {
        let measured = pattern.measured();
        if measured < self.min_positions {
            return Err(NoBearing::TooSparse { measured, needed: self.min_positions });
        }
        let maximum = pattern.maximum_dbm();
        let strongest: Resultant = above(pattern, maximum).map(Cell::angle).collect();
        let Some(angle) = strongest.direction(LEAST_RESULTANT) else {
            return Err(NoBearing::Ambiguous { resultant: strongest.length() });
        };
        let reach = above(pattern, maximum - self.width_db)
            .map(|cell| angle::distance(cell.angle(), angle))
            .fold(self.min_sigma, f64::max);
        if reach > self.max_sigma {
            return Err(NoBearing::TooWide { sigma: reach, limit: self.max_sigma });
        }
        Ok(Bearing { angle, sigma: reach, confidence: resultant_confidence(pattern) })
    }
}

/// The positions whose rounded moving mean is at least `level`.
fn above(pattern: &Pattern, level: f64) -> impl Iterator<Item = &Cell> {
    pattern.cells().iter().filter(move |cell| cell.rounded_dbm().is_some_and(|dbm| dbm >= level))
}

impl BearingExtractor for Pritzl2018 {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let mut pattern = Pattern::empty();
        pattern.fill(sweep, self.window)?;
        Ok(Reading {
            rss_dbm: pattern.rss_dbm(),
            rss_sigma_db: self.rss_sigma_db,
            bearing: self.bearing(&pattern),
            covariance: 0.0,
            modes: BearingModes::default(),
        })
    }
}

/// Settings as they stand in a file, each with its default; read back only through the setters.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Fields {
    window: u16,
    rss_sigma_db: f64,
    width_db: f64,
    max_sigma: f64,
    min_sigma: f64,
    min_positions: u16,
}

#[cfg(feature = "serde")]
impl Default for Fields {
    fn default() -> Self {
        Pritzl2018::default().into()
    }
}

#[cfg(feature = "serde")]
impl TryFrom<Fields> for Pritzl2018 {
    type Error = ParameterError;

    fn try_from(fields: Fields) -> Result<Self, ParameterError> {
        Self::default()
            .with_window(fields.window)?
            .with_rss_sigma_db(fields.rss_sigma_db)?
            .with_width_db(fields.width_db)?
            .with_max_sigma(fields.max_sigma)?
            .with_min_sigma(fields.min_sigma)?
            .with_min_positions(fields.min_positions)
    }
}

#[cfg(feature = "serde")]
impl From<Pritzl2018> for Fields {
    fn from(extractor: Pritzl2018) -> Self {
        Self {
            window: extractor.window,
            rss_sigma_db: extractor.rss_sigma_db,
            width_db: extractor.width_db,
            max_sigma: extractor.max_sigma,
            min_sigma: extractor.min_sigma,
            min_positions: extractor.min_positions,
        }
    }
}
