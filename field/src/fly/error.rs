use std::io;

use foxhunt_core::parameter::FieldError;
use foxhunt_hardware::cot::CotError;
use foxhunt_hunt::{
    config::{ExtractorConfigError, PlannerConfigError},
    hunt::HuntError,
    registry::{PartsError, RegistryError},
};
use foxhunt_wire::{geodesy::GeodesyError, terrain::TerrainError};

use super::MissionError;

/// Reason why a flight cannot be prepared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FlyError {
    /// The file cannot be read.
    #[error("{file}: cannot be read")]
    Read {
        /// The file.
        file: String,
        /// Cause of the failure.
        source: io::Error,
    },
    /// The file is no configuration of a flight.
    #[error("{file}: {source}")]
    Parse {
        /// The file.
        file: String,
        /// Description of the error, with line and field.
        source: toml::de::Error,
    },
    /// The addresses of teams, or the certificates for them, contradict each other.
    #[error("{file}: cot.{source}")]
    Cot {
        /// The file.
        file: String,
        /// Description of the error, with the field.
        source: CotError,
    },
    /// The origin is no place.
    #[error("site: {0}")]
    Site(#[from] GeodesyError),
    /// The ground's heights are not known.
    #[error("terrain: {0}")]
    Terrain(#[from] TerrainError),
    /// A field is out of its range.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The extractor that turns go by cannot be built.
    #[error(transparent)]
    Extractor(#[from] ExtractorConfigError),
    /// The estimator's name is not known.
    #[error("estimator: {0}")]
    Estimator(#[from] RegistryError),
    /// No drone or no beacon was given.
    #[error("there are no {missing}")]
    Nothing {
        /// Name of what is missing.
        missing: &'static str,
    },
    /// Two drones have one name.
    #[error("there are two drones {drone:?}")]
    Twice {
        /// The name.
        drone: String,
    },
    /// A drone's devices are not as they must be.
    #[error("drone {drone:?}: {reason}")]
    Drone {
        /// The drone.
        drone: String,
        /// Description of the fault.
        reason: String,
    },
    /// A port cannot be opened.
    #[error("drone {drone:?}: {device}: {source}")]
    Open {
        /// The drone.
        drone: String,
        /// Kind of the device.
        device: &'static str,
        /// Cause of the failure.
        source: io::Error,
    },
    /// The planner goes by what is received.
    #[error(
        "the planner's places depend on what is received; those of `waypoints`, `lawn-mower` and \
         `hold` are known beforehand"
    )]
    Route,
    /// There is no such planner, or it refuses.
    #[error(transparent)]
    Planner(#[from] PlannerConfigError),
    /// The hunt cannot begin as planned.
    #[error("the hunt could not begin: {0}")]
    Plan(#[source] HuntError),
    /// The hunt cannot be put together.
    #[error(transparent)]
    Parts(#[from] PartsError),
    /// The flight cannot begin.
    #[error(transparent)]
    Mission(#[from] MissionError),
}
