//! Parts picked at run time: what stands in files and on the command line.

mod boxed;
mod estimator;
mod extractor;
mod filter;
mod model;
mod planner;
mod pulses;
mod registry_error;
mod shape;
mod source;
mod terrain;

pub use boxed::{BoxedEstimator, CloneEstimator};
pub use estimator::{EstimatorConfig, MovingConfig};
pub use extractor::{
    BoxedExtractor, ExtractorConfig, ExtractorConfigError, KnownAntennaConfig, LobeConfig,
};
pub use filter::{AnyModel, AnyMotion, FilterConfig, GateConfig, OutlierConfig, Prior};
pub(crate) use model::FREQUENCY_MHZ;
pub use model::{ModelConfig, ModelError, ReceiverModel};
pub use planner::{PlannerConfig, PlannerConfigError};
pub use pulses::{PulseLevelConfig, PulseModel};
pub use registry_error::RegistryError;
pub use shape::{BoxedShape, ShapeConfig};
pub use source::{Questions, SourceConfig};
pub use terrain::ModelTerrain;
