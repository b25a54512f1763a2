//! Experiments: simulated hunts, drawn trials and turns, run many times over on any number of
//! threads.
//!
//! Every comparison is an [`Experiment`] that a [`Runner`] runs: [`campaign`]s of flown hunts,
//! whatever they compare, [`trial`]s on drawn bearings, and single turns for the extractors
//! ([`bearing_trial`]). With the feature `store`, `store` keeps campaigns in a file.

pub mod bearing_trial;
pub mod campaign;
mod experiment;
mod paired;
pub mod report;
pub mod simulation;
pub mod soak;
mod statistics;
#[cfg(feature = "store")]
pub mod store;
pub mod trial;

pub use experiment::{Experiment, Runner, ThreadsError};
pub use paired::{Paired, PairedDifference};
pub use statistics::{FirstPassage, Spread, StepSpread};
