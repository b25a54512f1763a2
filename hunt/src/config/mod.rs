//! Parts picked at run time: what stands in files and on the command line.

mod model;
mod source;
mod terrain;

pub use foxhunt_estimators::{
    AnyModel, AnyMotion, BoxedEstimator, CloneEstimator, EstimatorConfig, FilterConfig, FilterOf,
    GateConfig, IntoDyn, MovingConfig, OutlierConfig, ParticleConfig, Prior, PulseLevelConfig,
    PulseModel, ReceiverModel, ReceiversConfig, SeveralConfig,
};
pub(crate) use foxhunt_locate::FREQUENCY_MHZ;
#[cfg(feature = "maps")]
pub use foxhunt_parts::{BayesianOptimisation, BayesianOptimisationConfig};
pub use foxhunt_parts::{
    BoxedExtractor, BoxedShape, ExtractorConfig, ExtractorConfigError, LobeConfig, PlaceConfig,
    PlannerConfig, PlannerConfigError, RegistryError, ShapeConfig,
};
pub use model::{ModelConfig, ModelError};
pub use source::{Questions, SourceConfig};
pub use terrain::ModelTerrain;
