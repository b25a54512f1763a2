//! Parts picked at run time: what stands in files and on the command line.

mod extractor;
mod model;
mod planner;
mod pulses;
mod registry_error;
mod shape;
mod source;
mod terrain;

pub use extractor::{BoxedExtractor, ExtractorConfig, ExtractorConfigError, LobeConfig};
pub use foxhunt_estimators::{
    AnyModel, AnyMotion, BoxedEstimator, CloneEstimator, EstimatorConfig, FilterConfig, FilterOf,
    GateConfig, MovingConfig, OutlierConfig, ParticleConfig, Prior, ReceiverModel, ReceiversConfig,
    SeveralConfig,
};
pub(crate) use model::FREQUENCY_MHZ;
pub use model::{ModelConfig, ModelError};
pub use planner::{PlaceConfig, PlannerConfig, PlannerConfigError};
pub use pulses::{PulseLevelConfig, PulseModel};
pub use registry_error::RegistryError;
pub use shape::{BoxedShape, ShapeConfig};
pub use source::{Questions, SourceConfig};
pub use terrain::ModelTerrain;
