use foxhunt_core::{
    BearingExtractor, Reading, Sample,
    parameter::{ParameterError, positive},
};
use foxhunt_sensors::{
    AntennaConfig, AntennaError, CrossCorrelation, FirstHarmonic, MainLobeFit, Maximum,
    MaximumLikelihood, Pritzl2018, Residuals,
};
use serde::{Deserialize, Serialize};

use super::RegistryError;

/// A bearing extractor chosen at run time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ExtractorConfig {
    /// The maximum of the moving mean, with its 2 dB width as σ (Pritzl 2018, §4.1–4.2).
    Pritzl2018(Pritzl2018),
    /// [`Maximum`].
    Maximum(LobeConfig),
    /// [`FirstHarmonic`] of the power.
    FirstHarmonic(LobeConfig),
    /// [`FirstHarmonic`] of the level in dB.
    FirstHarmonicDb(LobeConfig),
    /// [`MainLobeFit`].
    MainLobe(LobeConfig),
    /// [`CrossCorrelation`].
    CrossCorrelation(KnownAntennaConfig),
    /// [`MaximumLikelihood`] with [`Residuals::Gaussian`].
    MaximumLikelihood(KnownAntennaConfig),
    /// [`MaximumLikelihood`] with [`Residuals::StudentT`].
    MaximumLikelihoodT(KnownAntennaConfig),
    /// [`MaximumLikelihood`] with [`Residuals::Reflection`].
    MaximumLikelihoodReflection(KnownAntennaConfig),
    /// [`MaximumLikelihood`] with [`Residuals::Superposed`].
    MaximumLikelihoodSeveral(KnownAntennaConfig),
    /// One that a [`Registry`](crate::registry::Registry) knows by a name.
    Registered {
        /// The name.
        name: String,
    },
}

/// Settings of an extractor that knows no more of the antenna than that it has a main lobe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LobeConfig {
    /// σ of the level against a path-loss law, in dB.
    pub rss_sigma_db: f64,
}

impl Default for LobeConfig {
    /// 7.9 dB, as the reference has it.
    fn default() -> Self {
        Self { rss_sigma_db: Reading::RSS_SIGMA_DB }
    }
}

/// Settings of an extractor that knows the antenna.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KnownAntennaConfig {
    /// The antenna.
    pub antenna: AntennaConfig,
    /// Elevation of beacons above the horizon, in degrees; below it where negative.
    pub elevation_deg: f64,
    /// Beacons may be anywhere from there to so far above the horizon, in degrees, for
    /// `maximum-likelihood`; absent where they are at that elevation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steepest_deg: Option<f64>,
    /// σ of a reading in dB, where a turn does not show it.
    pub sample_sigma_db: f64,
    /// σ in dB of what the pattern leaves of a boresight's mean, whatever the number of readings.
    pub misfit_sigma_db: f64,
    /// σ of the level against a path-loss law, in dB.
    pub rss_sigma_db: f64,
    /// Largest σ of a bearing, in degrees; turns with a larger one have no bearing.
    pub max_sigma_deg: f64,
    /// Turns in which fewer boresights hold a reading have no bearing.
    pub min_positions: u16,
    /// The degrees of freedom of Student's t, for the extractor that has them.
    pub degrees: f64,
}

impl Default for KnownAntennaConfig {
    /// The reference patch, beacons on the horizon alone, readings of 2 dB, no misfit, 7.9 dB for
    /// the level, bearings up to 57° from 8 boresights on, 4 degrees of freedom.
    fn default() -> Self {
        Self {
            antenna: AntennaConfig::default(),
            elevation_deg: 0.0,
            steepest_deg: None,
            sample_sigma_db: Sample::SIGMA_DB,
            misfit_sigma_db: 0.0,
            rss_sigma_db: Reading::RSS_SIGMA_DB,
            max_sigma_deg: 57.0,
            min_positions: 8,
            degrees: 4.0,
        }
    }
}

/// Requirement of a setting of another extractor.
const UNUSED: &str = "left out: this extractor does not use it";

/// Reason why there is no extractor.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExtractorConfigError {
    /// The antenna cannot be built.
    #[error("extractor.antenna: {0}")]
    Antenna(#[from] AntennaError),
    /// A field is out of its range.
    #[error("extractor: {0}")]
    Field(#[from] ParameterError),
    /// The extractor's name is not known.
    #[error("extractor.name: {0}")]
    Name(#[from] RegistryError),
    /// It is known by name alone, and no registry is at hand; or its entry is itself a name.
    #[error("extractor.name is {name:?}, which only a registry can build")]
    Circle {
        /// The name.
        name: String,
    },
}

/// An extractor that was chosen at run time, for any thread.
pub type BoxedExtractor = Box<dyn BearingExtractor + Send + Sync>;

impl ExtractorConfig {
    /// Builds the extractor; reads the antenna's file, if it has one.
    ///
    /// # Errors
    ///
    /// [`ExtractorConfigError`] names what is out of its range.
    pub fn build(&self) -> Result<BoxedExtractor, ExtractorConfigError> {
        let harmonic = |config: &LobeConfig, harmonic: FirstHarmonic| {
            harmonic.with_rss_sigma_db(config.rss_sigma_db)
        };
        Ok(match self {
            Self::Pritzl2018(extractor) => Box::new(*extractor),
            Self::Maximum(c) => Box::new(Maximum::default().with_rss_sigma_db(c.rss_sigma_db)?),
            Self::FirstHarmonic(c) => Box::new(harmonic(c, FirstHarmonic::default())?),
            Self::FirstHarmonicDb(c) => Box::new(harmonic(c, FirstHarmonic::in_decibels())?),
            Self::MainLobe(c) => {
                Box::new(MainLobeFit::default().with_rss_sigma_db(c.rss_sigma_db)?)
            }
            Self::CrossCorrelation(c) => {
                c.refuse(&["elevation_deg", "steepest_deg", "sample_sigma_db"])?;
                c.refuse(&["misfit_sigma_db", "min_positions", "degrees"])?;
                Box::new(
                    CrossCorrelation::new(c.antenna.build()?)
                        .with_rss_sigma_db(c.rss_sigma_db)?
                        .with_max_sigma(c.max_sigma_deg.to_radians())?,
                )
            }
            Self::MaximumLikelihood(c) => {
                c.refuse(&["degrees"])?;
                c.likelihood(Residuals::Gaussian)?
            }
            Self::MaximumLikelihoodT(c) => {
                c.refuse(&["steepest_deg"])?;
                c.likelihood(Residuals::StudentT { degrees: c.degrees })?
            }
            Self::MaximumLikelihoodReflection(c) => {
                c.refuse(&["steepest_deg", "degrees"])?;
                c.likelihood(Residuals::Reflection)?
            }
            Self::MaximumLikelihoodSeveral(c) => {
                c.refuse(&["steepest_deg", "degrees"])?;
                c.likelihood(Residuals::Superposed)?
            }
            Self::Registered { name } => {
                return Err(ExtractorConfigError::Circle { name: name.clone() });
            }
        })
    }

    /// The antenna that it knows, and how far above the horizon it takes beacons to be, in radians;
    /// `None` for one that does not know its antenna.
    #[must_use]
    pub fn known_antenna(&self) -> Option<(&AntennaConfig, f64)> {
        match self {
            Self::CrossCorrelation(known)
            | Self::MaximumLikelihood(known)
            | Self::MaximumLikelihoodT(known)
            | Self::MaximumLikelihoodReflection(known)
            | Self::MaximumLikelihoodSeveral(known) => {
                Some((&known.antenna, known.elevation_deg.to_radians()))
            }
            _ => None,
        }
    }

    /// Returns true if a turn may have several directions that compete for one transmitter.
    #[must_use]
    pub fn directions_compete(&self) -> bool {
        matches!(
            self,
            Self::MaximumLikelihood(_)
                | Self::MaximumLikelihoodT(_)
                | Self::MaximumLikelihoodReflection(_)
        )
    }

    /// The extractor with another antenna; `None` for one that does not know its antenna.
    #[must_use]
    pub fn with_antenna(mut self, antenna: &AntennaConfig) -> Option<Self> {
        match &mut self {
            Self::CrossCorrelation(known)
            | Self::MaximumLikelihood(known)
            | Self::MaximumLikelihoodT(known)
            | Self::MaximumLikelihoodReflection(known)
            | Self::MaximumLikelihoodSeveral(known) => known.antenna = antenna.clone(),
            _ => return None,
        }
        Some(self)
    }
}

impl KnownAntennaConfig {
    /// Refuses each of the named settings that differs from its default, because the extractor does
    /// not use it.
    fn refuse(&self, unused: &[&str]) -> Result<(), ParameterError> {
        let default = Self::default();
        let settings = [
            ("elevation_deg", Some(self.elevation_deg), Some(default.elevation_deg)),
            ("steepest_deg", self.steepest_deg, default.steepest_deg),
            ("sample_sigma_db", Some(self.sample_sigma_db), Some(default.sample_sigma_db)),
            ("misfit_sigma_db", Some(self.misfit_sigma_db), Some(default.misfit_sigma_db)),
            ("min_positions", Some(self.min_positions.into()), Some(default.min_positions.into())),
            ("degrees", Some(self.degrees), Some(default.degrees)),
        ];
        for (name, value, default) in settings {
            if unused.contains(&name) && value != default {
                let value = value.unwrap_or(f64::NAN);
                return Err(ParameterError { name, value, requirement: UNUSED });
            }
        }
        Ok(())
    }

    fn likelihood(&self, residuals: Residuals) -> Result<BoxedExtractor, ExtractorConfigError> {
        positive("degrees", self.degrees)?;
        let extractor = MaximumLikelihood::new(self.antenna.build()?)
            .with_elevation(self.elevation_deg.to_radians())?
            .with_sample_sigma_db(self.sample_sigma_db)?
            .with_misfit_sigma_db(self.misfit_sigma_db)?
            .with_rss_sigma_db(self.rss_sigma_db)?
            .with_max_sigma(self.max_sigma_deg.to_radians())?
            .with_min_positions(self.min_positions)?;
        Ok(Box::new(match self.steepest_deg {
            Some(steepest) => extractor.with_steepest(steepest.to_radians())?,
            None => extractor.with_residuals(residuals),
        }))
    }
}

impl Default for ExtractorConfig {
    /// The reference's.
    fn default() -> Self {
        Self::Pritzl2018(Pritzl2018::default())
    }
}
