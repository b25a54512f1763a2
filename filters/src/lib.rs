//! Recursive and batch estimators of a transmitter's position.
//!
//! | estimator | belief | needs of a model | allocates |
//! |-|-|-|-|
//! | [`Ekf`] | Gaussian, linear about its mean | `expected`, `jacobian`, `residual` | never |
//! | [`Ukf`] | Gaussian, quadratic about its mean | `expected`, `residual` | never |
//! | [`Ckf`] | Gaussian, exact to degree 3 | `expected`, `residual` | never |
//! | [`GridFilter`] | mass of cells over an area | `log_likelihoods`, or `expected` and `jacobian` | as the cells follow the belief |
//! | [`ParticleFilter`] | weighted cloud | `log_likelihoods`, `expected`, `residual` | when it is made; as its size adapts; in an update by stages |
//! | [`RaoBlackwellised`] | cloud of Gaussians | `expected`, `jacobian`, `residual` | at every step |
//! | [`Bank`] | weighted sum of other estimators' | what they need | with its components |
//! | [`FirstBearing`] | the same, in a row along the first bearing | what its Kalman filters need | in every step |
//! | [`GaussianSum`] | sum of Gaussians, split and merged | what its Kalman filters need | in every step |
//! | [`Imm`] | a Gaussian for each mode of motion | what its estimators need | in every step |
//!
//! The first three are one struct, [`Kalman`], over the one thing in which they differ: how a
//! Gaussian goes through a map, a [`Transform`]. A [`Gate`] rejects outliers; with [`Iterations`]
//! each update is linearised again about its own posterior.
//!
//! `DynamicKalman` is the first three for a joint state whose size is known at run time only, such
//! as that of all targets or stations, over the same models. It needs the feature `alloc`, and with
//! `large-states` it uses faer from 32 dimensions on.
//!
//! [`Handover`] begins as one estimator and goes on as another: a grid makes the first bearings a
//! prior for a Kalman filter. [`Leading`] shows the first components of a larger state.
//!
//! [`OutOfOrder`] lets any of them use observations that arrive late at their own time.
//! [`Remembering`] and [`fixed_interval`] smooth a run of any that implements
//! [`Smooth`](foxhunt_core::Smooth), [`rauch_tung_striebel`] the moments of Gaussian ones.
//! [`consistency`] tests whether their covariances are right, and [`PosteriorCramerRao`] bounds
//! what any estimator can reach.
//!
//! From all readings of one flight at once, [`ShadowingGrid`] locates a transmitter of unknown
//! power whose level fades alike in neighbouring places.
//!
//! [`multi`] has filters of several transmitters, of one that may be absent, and of an unknown
//! number of them, over any of these estimators.
//!
//! [`vecchia`] makes readings independent whose errors are correlated by place.
//!
//! From single levels along the boresights of a directional antenna, such as a slow tag's pulses,
//! [`DirectionalGrid`] locates a transmitter without waiting for whole turns.
//!
//! From the near field of a magnetic dipole, [`MomentGrid`] locates one of unknown strength and
//! orientation.
//!
//! With the feature `batch`: `BatchSolver` fits all observations of a still target at once,
//! `BatchEstimator` does so after each; `Lenth1981`, `repeated_median` and the closed forms
//! `pseudolinear`, `stansfield` and `instrumental_variables` find where bearings meet,
//! `multilaterate` where ranges, and `spherical_intersection` where differences of ranges.
//!
//! With the feature `field-map`: `FieldMap` maps the level over the area without any law of
//! propagation.
//!
//! With the feature `parallel`: `ParticleFilter::with_threads` uses all threads of a rayon pool.
//!
//! The particle filter, the mixtures and the grid need the feature `alloc`; the rest runs without
//! an allocator.

#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

#[cfg(feature = "batch")]
mod batch;
#[cfg(feature = "batch")]
mod bearings;
#[cfg(feature = "alloc")]
pub mod consistency;
mod count;
#[cfg(feature = "alloc")]
mod cramer_rao;
mod derived;
#[cfg(feature = "alloc")]
mod directional_grid;
#[cfg(all(feature = "alloc", target_has_atomic = "ptr"))]
mod dynamic;
#[cfg(feature = "field-map")]
mod field_map;
mod gaussian;
#[cfg(feature = "alloc")]
mod grid;
mod kalman;
#[cfg(feature = "alloc")]
mod mixture;
#[cfg(feature = "alloc")]
mod moment_grid;
#[cfg(feature = "alloc")]
pub mod multi;
#[cfg(feature = "alloc")]
mod out_of_order;
#[cfg(feature = "alloc")]
mod particle;
#[cfg(feature = "alloc")]
mod peaks;
#[cfg(feature = "batch")]
mod ranges;
#[cfg(feature = "alloc")]
mod shadowing_grid;
mod smoothing;
#[cfg(feature = "batch")]
mod track_grid;
mod transform;
mod triangle;
#[cfg(feature = "alloc")]
pub mod vecchia;
#[cfg(feature = "alloc")]
mod vectorised;

#[cfg(feature = "batch")]
pub use batch::{BatchError, BatchEstimator, BatchFix, BatchSolver, Loss, independent_share};
#[cfg(feature = "batch")]
pub use bearings::{
    BearingFix, BearingGrid, BearingGridFix, BearingLine, BearingWeights, CommonErrors, Lenth1981,
    RepeatedMedianFix, StationError, instrumental_variables, pseudolinear, repeated_median,
    stansfield,
};
#[cfg(feature = "alloc")]
pub use cramer_rao::{CramerRaoError, FisherQuadrature, PosteriorCramerRao};
pub use derived::{Handover, Leading};
#[cfg(feature = "alloc")]
pub use directional_grid::{DirectionalGrid, DirectionalGridConfig};
#[cfg(all(feature = "alloc", target_has_atomic = "ptr"))]
pub use dynamic::{
    DynamicCkf, DynamicEkf, DynamicInnovation, DynamicKalman, DynamicUkf, JointMotion, Part,
};
#[cfg(feature = "field-map")]
pub use field_map::{FieldMap, FieldMapConfig, FieldMaximum, FieldModel};
pub use gaussian::{Gaussian, Innovation};
#[cfg(feature = "alloc")]
pub use grid::{GridConfig, GridFilter, NoiseScales};
pub use kalman::{Ckf, Ekf, Gate, GateLimit, Iterations, Kalman, Ukf};
#[cfg(feature = "alloc")]
pub use mixture::{
    Bank, FirstBearing, GaussianSum, Imm, InnovationOf, RangeParameterised, Reinitialise,
    Transition, polar_moments, split, split_standard_normal,
};
#[cfg(feature = "alloc")]
pub use moment_grid::MomentGrid;
#[cfg(feature = "alloc")]
pub use out_of_order::OutOfOrder;
#[cfg(feature = "alloc")]
pub use particle::{KldSampling, ParticleFilter, RaoBlackwellised, Resampling};
#[cfg(feature = "alloc")]
pub use peaks::peaks;
#[cfg(feature = "batch")]
pub use ranges::{
    SlantRange, SlantRangeDifference, multilaterate, multilaterate_with_bias, range_bias_sigmas,
    spherical_intersection,
};
#[cfg(feature = "alloc")]
pub use shadowing_grid::{
    Censoring, Intercept, Marginal, PlacePrior, PosteriorMap, ShadowedReading, ShadowingFix,
    ShadowingGrid, ShadowingGridConfig, ShadowingGridError, Slope,
};
pub use smoothing::{Passage, Passing};
#[cfg(feature = "alloc")]
pub use smoothing::{Remembering, fixed_interval, rauch_tung_striebel};
#[cfg(feature = "batch")]
pub use track_grid::{Places, TrackGrid, TrackGridFix, TrackModel};
pub use transform::{
    Cubature, DynamicTransform, Image, Kappa, Map, Moments, Taylor, Transform, TransformRule,
    Unscented,
};
