use clap::builder::PossibleValuesParser;
use foxhunt::config::{
    BoxedExtractor, ExtractorConfig, NamedExtractor, antenna_named, extractor_named, extractors,
};

use crate::error::CliError;

/// What makes bearings of turns, and what it knows of the antenna.
#[derive(Debug, clap::Args)]
pub(super) struct Extraction {
    /// The extractor that makes a bearing of a turn (`foxhunt extractors` explains them)
    #[arg(long, value_name = "NAME", value_parser = parser())]
    extractor: Option<String>,
    /// The antenna that the extractor knows, in bearing campaigns also the true one: reference-patch, isotropic, dipole, cardioid, patch,
    /// yagi, or a file (msi, pln, csv)
    #[arg(long, value_name = "NAME|FILE")]
    antenna: Option<String>,
}

/// Takes the name of an extractor; what is unknown is refused with the names that are known.
pub(super) fn parser() -> PossibleValuesParser {
    PossibleValuesParser::new(extractors().into_iter().map(|known| known.name))
}

/// The extractor of a name that the parser let through.
pub(super) fn named(name: &str) -> Result<NamedExtractor, CliError> {
    extractor_named(name).ok_or_else(|| CliError::input(format!("{name:?} is no extractor")))
}

impl Extraction {
    /// The extractor that was asked for, or else `own`, with the antenna that was asked for.
    pub(super) fn config(&self, own: &ExtractorConfig) -> Result<ExtractorConfig, CliError> {
        let config = match &self.extractor {
            Some(name) => named(name)?.config,
            None => own.clone(),
        };
        let Some(antenna) = &self.antenna else { return Ok(config) };
        config.with_antenna(&antenna_named(antenna)).ok_or_else(|| {
            CliError::input(
                "--antenna is for extractors that know it: cross-correlation and the likelihood ones",
            )
        })
    }

    /// The same built; the reference's where none was asked for.
    pub(super) fn build(&self) -> Result<BoxedExtractor, CliError> {
        self.config(&ExtractorConfig::default())?.build().map_err(CliError::input)
    }

    /// Every extractor there is, with the antenna that was asked for.
    pub(super) fn all(&self) -> Result<Vec<(&'static str, BoxedExtractor)>, CliError> {
        let antenna = self.antenna.as_deref().map(antenna_named);
        extractors()
            .into_iter()
            .map(|NamedExtractor { name, config, .. }| {
                let known = antenna.as_ref().and_then(|a| config.clone().with_antenna(a));
                let built = known.unwrap_or(config).build().map_err(CliError::input)?;
                Ok((name, built))
            })
            .collect()
    }

    /// Whether anything was asked for.
    pub(super) fn any(&self) -> bool {
        self.extractor.is_some() || self.antenna.is_some()
    }

    /// The extractor's name that was asked for.
    pub(super) fn name(&self) -> Option<&str> {
        self.extractor.as_deref()
    }

    /// The name of the extractor that [`build`](Self::build) makes.
    pub(super) fn built_name(&self) -> &'static str {
        let asked = |known: &NamedExtractor| self.extractor.as_deref() == Some(known.name);
        extractors().into_iter().find(asked).map_or("pritzl2018", |known| known.name)
    }

    /// The antenna's name that was asked for.
    pub(super) fn antenna(&self) -> Option<&str> {
        self.antenna.as_deref()
    }
}
