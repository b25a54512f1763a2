//! Estimators that are chosen at run time.
//!
//! A filter is generic over the sizes of its state and its measurement, and its code is compiled
//! wherever it is used. This package uses every filter once for each of the five sizes that hunts
//! and trials have ([`FilterOf`]), so that nothing above it compiles one again: it alone is worth
//! optimising, and it alone takes long to build.

mod boxed;
mod estimator;
mod filter;
mod track;

pub use boxed::{BoxedEstimator, CloneEstimator};
pub use estimator::{EstimatorConfig, MovingConfig, ReceiverModel};
pub use filter::{AnyModel, AnyMotion, FilterConfig, FilterOf, GateConfig, OutlierConfig, Prior};
pub use track::{Components, TimeStep, Track, TrackConfig, TrackError, TrackStep, WithoutBearing};
