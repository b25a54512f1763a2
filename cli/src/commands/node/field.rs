use std::{fs, path::Path};

use foxhunt::{
    config::ExtractorConfig,
    core::Quantity,
    fly::FlightConfig,
    hunt::Hunt,
    log::LogHeader,
    registry::{EstimatorEntry, Registry},
    scenario::Scenario,
    simulation::Setup,
};

use crate::{commands::choice, error::CliError};

/// Drones of a hunt on several computers.
pub enum Field {
    /// Simulated ones.
    Simulated(Box<Scenario>),
    /// Real ones.
    Flown(Box<FlightConfig>),
}

impl Field {
    /// The flight of a file, or the scenario of a built-in name or a file: a flight has a site.
    pub fn find(name_or_path: &str) -> Result<Self, CliError> {
        let path = Path::new(name_or_path);
        let text = fs::read_to_string(path).unwrap_or_default();
        let is_flight = text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("site"));
        if is_flight {
            let flight = FlightConfig::read(path).map_err(CliError::input)?;
            return Ok(Self::Flown(Box::new(flight)));
        }
        choice::scenario(name_or_path).map(|scenario| Self::Simulated(Box::new(scenario)))
    }

    pub fn name(&self) -> &str {
        match self {
            Self::Simulated(scenario) => &scenario.name,
            Self::Flown(flight) => &flight.name,
        }
    }

    pub fn drones(&self) -> usize {
        match self {
            Self::Simulated(scenario) => scenario.world.drones.len(),
            Self::Flown(flight) => flight.drones.len(),
        }
    }

    pub fn is_flown(&self) -> bool {
        matches!(self, Self::Flown(_))
    }

    /// Returns the estimator of the command line, or else the field's own; `file` names the field's
    /// file.
    pub fn estimator<'a>(
        &self,
        registry: &'a Registry,
        given: Option<&str>,
        file: &str,
    ) -> Result<&'a EstimatorEntry, CliError> {
        let own = match self {
            Self::Simulated(scenario) => &scenario.estimator,
            Self::Flown(flight) => &flight.estimator,
        };
        match given {
            Some(name) => choice::estimator(registry, name, "--estimator"),
            None => choice::estimator(registry, own, &format!("{file}: estimator")),
        }
    }

    /// Returns the extractor that reads bearings on board of the drones.
    pub fn extractor(&self) -> &ExtractorConfig {
        match self {
            Self::Simulated(scenario) => &scenario.extractor,
            Self::Flown(flight) => &flight.extractor,
        }
    }

    pub fn log_header(
        &self,
        registry: &Registry,
        estimator: &EstimatorEntry,
        seed: u64,
        epoch_unix_s: i64,
    ) -> LogHeader {
        match self {
            Self::Simulated(scenario) => {
                let header = Setup { scenario, estimator, registry }.log_header(seed);
                LogHeader { epoch_unix_s: Some(epoch_unix_s), ..header }
            }
            Self::Flown(flight) => flight.log_header(estimator, seed, Some(epoch_unix_s)),
        }
    }

    pub fn hunt(
        &self,
        registry: &Registry,
        estimator: &EstimatorEntry,
        seed: u64,
        file: &str,
    ) -> Result<Hunt, CliError> {
        let mut parts = match self {
            Self::Simulated(scenario) => {
                scenario.parts(registry, estimator, seed).map_err(CliError::input)?
            }
            Self::Flown(flight) => flight.parts(registry, estimator, seed),
        };
        // Nodes send what their extractors read in whole turns.
        parts.quantities.retain(|quantity| *quantity != Quantity::BORESIGHT);
        parts.build().map_err(|error| choice::simulation_error(error.into(), file))
    }
}
