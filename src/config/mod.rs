//! Parts picked at run time: what stands in files and on the command line.

mod boxed;
mod estimator;
mod extractor;
mod filter;
mod model;
mod named;
mod named_extractor;
mod named_planner;
mod planner;
mod shape;
mod source;

pub use boxed::{BoxedEstimator, CloneEstimator};
pub(crate) use estimator::with_power;
pub use estimator::{EstimatorConfig, MovingConfig};
pub use extractor::{
    BoxedExtractor, ExtractorConfig, ExtractorConfigError, KnownAntennaConfig, LobeConfig,
};
pub use filter::{FilterConfig, GateConfig, OutlierConfig, beacon_seed};
pub use model::{ModelConfig, ReceiverModel};
pub use named::{DEFAULT_ESTIMATOR, NamedEstimator, estimator_named, estimators};
pub use named_extractor::{
    NamedExtractor, RECOMMENDED_EXTRACTOR, antenna_named, extractor_named, extractors,
};
pub use named_planner::{NamedPlanner, planner_named, planners};
pub use planner::{PlannerConfig, PlannerConfigError};
pub use shape::{BoxedShape, ShapeConfig};
pub use source::{BoxedSource, SourceConfig, SourceError, boxed};
