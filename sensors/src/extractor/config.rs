use super::{Pattern, Pritzl2018};
use foxhunt_core::parameter::{ParameterError, not_negative, positive, require};

impl Pritzl2018 {
    /// Sets a moving mean over `positions`, an odd number of them.
    ///
    /// # Errors
    ///
    /// When the number is even or above the pattern's capacity.
    pub fn with_window(self, positions: u16) -> Result<Self, ParameterError> {
        let valid = positions % 2 == 1 && positions <= Pattern::CAPACITY;
        require(valid, "window", positions.into(), "odd and at most 360")?;
        Ok(Self { window: positions, ..self })
    }

    /// Sets another standard deviation of the level, in dB.
    ///
    /// # Errors
    ///
    /// When it is not a positive number.
    pub fn with_rss_sigma_db(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { rss_sigma_db: positive("rss_sigma_db", sigma)?, ..self })
    }

    /// The same with the bearing's σ taken where the pattern has fallen by `width` dB.
    ///
    /// # Errors
    ///
    /// When it is negative or not finite.
    pub fn with_width_db(self, width: f64) -> Result<Self, ParameterError> {
        Ok(Self { width_db: not_negative("width_db", width)?, ..self })
    }

    /// The same with bearings used up to the standard deviation `sigma`, in radians.
    ///
    /// # Errors
    ///
    /// When it is not a positive number.
    pub fn with_max_sigma(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { max_sigma: positive("max_sigma", sigma)?, ..self })
    }

    /// The same with no bearing's standard deviation below `sigma` radians.
    ///
    /// # Errors
    ///
    /// When it is negative or not finite. At 0 a pattern with a single position on top has the
    /// σ of 0, which no [`Observation`](foxhunt_core::Observation) takes.
    pub fn with_min_sigma(self, sigma: f64) -> Result<Self, ParameterError> {
        Ok(Self { min_sigma: not_negative("min_sigma", sigma)?, ..self })
    }

    /// The same with bearings only from turns in which at least `positions` were received.
    ///
    /// # Errors
    ///
    /// When it is 0 or above the pattern's capacity.
    pub fn with_min_positions(self, positions: u16) -> Result<Self, ParameterError> {
        let valid = (1..=Pattern::CAPACITY).contains(&positions);
        require(valid, "min_positions", positions.into(), "1 to 360")?;
        Ok(Self { min_positions: positions, ..self })
    }
}

/// The fields as they stand in a file, each with its default; read back only through the setters.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Fields {
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
