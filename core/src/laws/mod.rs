//! The laws that implementors keep, as plain functions to call from a test.
//!
//! They take one case and panic on a breach, so they serve under `proptest`, under a seeded
//! loop, and in the tests of a crate that brings its own backend.

mod estimator;
mod extractor;
mod measurement;
mod motion;
mod planner;
mod source;

pub use estimator::{Checks, estimator, estimator_with};
pub use extractor::bearing_extractor;
pub use measurement::measurement_model;
pub use motion::motion_model;
pub use planner::formation_planner;
pub use source::pattern_source;
