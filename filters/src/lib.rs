//! Estimators: who is to be believed.
//!
//! | estimator | belief | needs of a model | allocates |
//! |-|-|-|-|
//! | [`Ekf`] | Gaussian, linear about its mean | `expected`, `jacobian`, `residual` | never |
//! | [`Ukf`] | Gaussian, quadratic about its mean | `expected`, `residual` | never |
//! | [`Ckf`] | Gaussian, exact to degree 3 | `expected`, `residual` | never |
//! | [`ParticleFilter`] | weighted cloud | `log_likelihoods`, `expected`, `residual` | once, when it is made |
//!
//! The first three are one struct, [`Kalman`], over the one thing that tells them apart: how a
//! Gaussian goes through a map, a [`Transform`]. What is kept out is a [`Gate`]'s business; with
//! [`Iterations`] each update is linearised again about its own posterior.
//!
//! From all readings of one flight at once, [`ShadowingGrid`] locates a transmitter of unknown
//! power whose level fades alike in neighbouring places.
//!
//! With the feature `batch`: `BatchSolver` fits all observations of a still target at once,
//! `BatchEstimator` does so after each; `Lenth1981`, `repeated_median` and the closed forms
//! `pseudolinear`, `stansfield` and `instrumental_variables` find where bearings meet,
//! `multilaterate` where ranges, and `spherical_intersection` where differences of ranges.
//! `FieldMap` maps the level over the area without any law of propagation.
//!
//! The particle filter and the grid need the feature `alloc`; the rest runs without an allocator.

#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;

#[cfg(feature = "batch")]
mod batch;
#[cfg(feature = "batch")]
mod bearings;
mod count;
#[cfg(feature = "batch")]
mod field_map;
mod gaussian;
mod kalman;
#[cfg(feature = "alloc")]
mod particle;
#[cfg(feature = "batch")]
mod ranges;
#[cfg(feature = "alloc")]
mod shadowing_grid;
mod transform;
mod triangle;

#[cfg(feature = "batch")]
pub use batch::{BatchError, BatchEstimator, BatchFix, BatchSolver, Loss};
#[cfg(feature = "batch")]
pub use bearings::{
    BearingFix, BearingLine, BearingWeights, Lenth1981, RepeatedMedianFix, instrumental_variables,
    pseudolinear, repeated_median, stansfield,
};
#[cfg(feature = "batch")]
pub use field_map::{FieldMap, FieldMapConfig, FieldMaximum, FieldModel};
pub use gaussian::Gaussian;
pub use kalman::{Ckf, Ekf, Gate, GateLimit, Innovation, Iterations, Kalman, Ukf};
#[cfg(feature = "alloc")]
pub use particle::{ParticleFilter, Resampling};
#[cfg(feature = "batch")]
pub use ranges::{SlantRange, SlantRangeDifference, multilaterate, spherical_intersection};
#[cfg(feature = "alloc")]
pub use shadowing_grid::{
    Intercept, Marginal, PosteriorMap, ShadowingFix, ShadowingGrid, ShadowingGridConfig,
    ShadowingGridError, Slope,
};
pub use transform::{Cubature, Image, Kappa, Map, Taylor, Transform, Unscented};
