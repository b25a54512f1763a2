use foxhunt_core::{BearingExtractor, Reading, parameter::ParameterError};
use foxhunt_sensors::{
    AntennaConfig, AntennaError, CrossCorrelation, CrossCorrelationConfig, FirstHarmonic,
    MainLobeFit, Maximum, MaximumLikelihood, MaximumLikelihoodConfig, Pritzl2018, Residuals,
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
    CrossCorrelation(CrossCorrelationConfig<AntennaConfig>),
    /// [`MaximumLikelihood`] with [`Residuals::Gaussian`].
    MaximumLikelihood(MaximumLikelihoodConfig<AntennaConfig>),
    /// [`MaximumLikelihood`] with [`Residuals::StudentT`].
    MaximumLikelihoodT(MaximumLikelihoodConfig<AntennaConfig>),
    /// [`MaximumLikelihood`] with [`Residuals::Reflection`].
    MaximumLikelihoodReflection(MaximumLikelihoodConfig<AntennaConfig>),
    /// [`MaximumLikelihood`] with [`Residuals::Superposed`].
    MaximumLikelihoodSeveral(MaximumLikelihoodConfig<AntennaConfig>),
    /// One that a registry knows by a name.
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
            Self::CrossCorrelation(config) => {
                Box::new(CrossCorrelation::with_config(config.through(config.antenna.build()?))?)
            }
            Self::MaximumLikelihood(config) => likelihood(config, Residuals::Gaussian)?,
            Self::MaximumLikelihoodT(config) => likelihood(config, Residuals::StudentT)?,
            Self::MaximumLikelihoodReflection(config) => likelihood(config, Residuals::Reflection)?,
            Self::MaximumLikelihoodSeveral(config) => likelihood(config, Residuals::Superposed)?,
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
            Self::CrossCorrelation(config) => Some((&config.antenna, 0.0)),
            Self::MaximumLikelihood(config)
            | Self::MaximumLikelihoodT(config)
            | Self::MaximumLikelihoodReflection(config)
            | Self::MaximumLikelihoodSeveral(config) => {
                Some((&config.antenna, config.elevation_deg.to_radians()))
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
            Self::CrossCorrelation(config) => config.antenna = antenna.clone(),
            Self::MaximumLikelihood(config)
            | Self::MaximumLikelihoodT(config)
            | Self::MaximumLikelihoodReflection(config)
            | Self::MaximumLikelihoodSeveral(config) => config.antenna = antenna.clone(),
            _ => return None,
        }
        Some(self)
    }
}

impl Default for ExtractorConfig {
    /// The reference's.
    fn default() -> Self {
        Self::Pritzl2018(Pritzl2018::default())
    }
}

fn likelihood(
    config: &MaximumLikelihoodConfig<AntennaConfig>,
    residuals: Residuals,
) -> Result<BoxedExtractor, ExtractorConfigError> {
    let config = config.through(config.antenna.build()?);
    Ok(Box::new(MaximumLikelihood::with_config(config, residuals)?))
}
