//! Extractors, planners and shapes that are chosen at run time.
//!
//! Code over any antenna or model is compiled here once, with optimisation, and nothing above
//! compiles it again; the estimators have a package of their own. A name that no part has is a
//! [`RegistryError`].

#[cfg(feature = "maps")]
mod bayesian_optimisation;
mod extractor;
mod planner;
mod registry_error;
mod shape;

#[cfg(feature = "maps")]
pub use bayesian_optimisation::{BayesianOptimisation, BayesianOptimisationConfig};
pub use extractor::{BoxedExtractor, ExtractorConfig, ExtractorConfigError, LobeConfig};
pub use planner::{PlaceConfig, PlannerConfig, PlannerConfigError};
pub use registry_error::RegistryError;
pub use shape::{BoxedShape, ShapeConfig};
