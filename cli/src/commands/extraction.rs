use foxhunt::{
    config::{BoxedExtractor, ExtractorConfig},
    registry::{ExtractorEntry, Registry, antenna_named},
};

use crate::error::CliError;

/// Extractor of bearings from turns, and the antenna that it knows.
#[derive(Debug, clap::Args)]
pub(super) struct Extraction {
    /// The extractor of bearings from turns (`foxhunt list extractors` describes them)
    #[arg(long, value_name = "NAME")]
    extractor: Option<String>,
    /// The antenna that the extractor knows: reference-patch, isotropic, dipole, cardioid, patch,
    /// yagi, or a file (msi, pln, csv)
    #[arg(long, value_name = "NAME|FILE")]
    antenna: Option<String>,
}

/// Name of the default extractor.
const DEFAULT: &str = "pritzl2018";

impl Extraction {
    /// The extractor of the command line, or else `own`, with the antenna of the command line.
    pub(super) fn config(
        &self,
        registry: &Registry,
        own: &ExtractorConfig,
    ) -> Result<ExtractorConfig, CliError> {
        let config = match &self.extractor {
            Some(name) => registry.extractor(name).map_err(CliError::input)?.config(),
            None => own.clone(),
        };
        let Some(antenna) = &self.antenna else { return Ok(config) };
        config.with_antenna(&antenna_named(antenna)).ok_or_else(|| {
            CliError::input(
                "--antenna is for extractors that know it: cross-correlation and the likelihood \
                 ones",
            )
        })
    }

    /// Builds the extractor of the command line, or else the reference's.
    pub(super) fn build(&self, registry: &Registry) -> Result<BoxedExtractor, CliError> {
        let config = self.config(registry, &ExtractorConfig::default())?;
        registry.build_extractor(&config).map_err(CliError::input)
    }

    /// Builds every extractor; with the command line's antenna if the extractor takes one.
    pub(super) fn all<'a>(
        &self,
        registry: &'a Registry,
    ) -> Result<Vec<(&'a str, BoxedExtractor)>, CliError> {
        let antenna = self.antenna.as_deref().map(antenna_named);
        let build = |entry: &'a ExtractorEntry| {
            let config = entry.config();
            let known = antenna.as_ref().and_then(|a| config.clone().with_antenna(a));
            let built = registry.build_extractor(&known.unwrap_or(config));
            Ok((entry.name.as_ref(), built.map_err(CliError::input)?))
        };
        registry.extractors().iter().map(build).collect()
    }

    /// Returns true if the command line has an extractor or an antenna.
    pub(super) fn is_given(&self) -> bool {
        self.extractor.is_some() || self.antenna.is_some()
    }

    /// The name of the extractor that [`build`](Self::build) makes.
    pub(super) fn name(&self) -> &str {
        self.extractor.as_deref().unwrap_or(DEFAULT)
    }
}
