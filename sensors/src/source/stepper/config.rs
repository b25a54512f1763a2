use foxhunt_core::parameter::{ParameterError, at_least_one, finite, positive};

/// Positions, samples and time-outs of a stepped antenna's turn.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Fields", into = "Fields"))]
pub struct StepperConfig {
    positions: u16,
    samples_per_position: u16,
    position_timeout: f64,
    first_timeout: f64,
    mount_offset: f64,
    floor_dbm: Option<f64>,
}

/// The configuration of the source, [`pritzl2018`](StepperConfig::pritzl2018).
impl Default for StepperConfig {
    fn default() -> Self {
        Self::pritzl2018()
    }
}

impl StepperConfig {
    /// 128 positions, 6 samples at each, at most 0.4 s for a position and 2 s for the first
    /// (Pritzl 2018, §4.1); an antenna that looks along the nose at 0.
    #[must_use]
    pub fn pritzl2018() -> Self {
        Self {
            positions: 128,
            samples_per_position: 6,
            position_timeout: 0.4,
            first_timeout: 2.0,
            mount_offset: 0.0,
            floor_dbm: None,
        }
    }

    /// Sets another number of positions in a turn.
    ///
    /// # Errors
    ///
    /// If it is 0.
    pub fn with_positions(self, positions: u16) -> Result<Self, ParameterError> {
        at_least_one("positions", positions.into())?;
        Ok(Self { positions, ..self })
    }

    /// Sets another number of samples at each position.
    ///
    /// # Errors
    ///
    /// If it is 0.
    pub fn with_samples_per_position(self, samples: u16) -> Result<Self, ParameterError> {
        at_least_one("samples_per_position", samples.into())?;
        Ok(Self { samples_per_position: samples, ..self })
    }

    /// Sets other time-outs in seconds, each from the order to turn: of any position, and
    /// of the first of a turn, which may be far away.
    ///
    /// # Errors
    ///
    /// If one is not a positive number.
    pub fn with_timeouts(self, position: f64, first: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            position_timeout: positive("position_timeout", position)?,
            first_timeout: positive("first_timeout", first)?,
            ..self
        })
    }

    /// Sets an antenna that looks `offset` radians counter-clockwise of the nose at the
    /// rotator's 0.
    ///
    /// # Errors
    ///
    /// If it is not finite.
    pub fn with_mount_offset(self, offset: f64) -> Result<Self, ParameterError> {
        Ok(Self { mount_offset: finite("mount_offset", offset)?, ..self })
    }

    /// Sets a receiver whose weakest reading is `floor` dBm.
    ///
    /// # Errors
    ///
    /// If it is not finite.
    pub fn with_floor_dbm(self, floor: f64) -> Result<Self, ParameterError> {
        Ok(Self { floor_dbm: Some(finite("floor_dbm", floor)?), ..self })
    }

    /// Number of positions in a turn.
    #[must_use]
    pub fn positions(&self) -> u16 {
        self.positions
    }

    /// Number of samples requested at each position.
    #[must_use]
    pub fn samples_per_position(&self) -> u16 {
        self.samples_per_position
    }

    /// The most a position takes, in seconds.
    #[must_use]
    pub fn position_timeout(&self) -> f64 {
        self.position_timeout
    }

    /// The most the first position of a turn takes, in seconds.
    #[must_use]
    pub fn first_timeout(&self) -> f64 {
        self.first_timeout
    }

    /// The antenna's direction at the rotator's 0, in radians from the nose.
    #[must_use]
    pub fn mount_offset(&self) -> f64 {
        self.mount_offset
    }

    /// The receiver's weakest reading in dBm, where that is known.
    #[must_use]
    pub fn floor_dbm(&self) -> Option<f64> {
        self.floor_dbm
    }

    /// Maximum duration of a turn for `beacons` beacons, in seconds, if it is polled often enough:
    /// every position has its time-out for each of them.
    #[must_use]
    pub fn longest_turn(&self, beacons: u16) -> f64 {
        let later = f64::from(self.positions) * f64::from(beacons.max(1)) - 1.0;
        self.first_timeout + later * self.position_timeout
    }
}

/// The fields as they stand in a file, each with its default; read back only through the setters.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Fields {
    positions: u16,
    samples_per_position: u16,
    position_timeout: f64,
    first_timeout: f64,
    mount_offset: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    floor_dbm: Option<f64>,
}

#[cfg(feature = "serde")]
impl Default for Fields {
    fn default() -> Self {
        StepperConfig::default().into()
    }
}

#[cfg(feature = "serde")]
impl TryFrom<Fields> for StepperConfig {
    type Error = ParameterError;

    fn try_from(fields: Fields) -> Result<Self, ParameterError> {
        let config = Self::default()
            .with_positions(fields.positions)?
            .with_samples_per_position(fields.samples_per_position)?
            .with_timeouts(fields.position_timeout, fields.first_timeout)?
            .with_mount_offset(fields.mount_offset)?;
        fields.floor_dbm.map_or(Ok(config), |floor| config.with_floor_dbm(floor))
    }
}

#[cfg(feature = "serde")]
impl From<StepperConfig> for Fields {
    fn from(config: StepperConfig) -> Self {
        Self {
            positions: config.positions,
            samples_per_position: config.samples_per_position,
            position_timeout: config.position_timeout,
            first_timeout: config.first_timeout,
            mount_offset: config.mount_offset,
            floor_dbm: config.floor_dbm,
        }
    }
}
