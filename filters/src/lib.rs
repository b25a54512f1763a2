//! Estimators: who is to be believed.
//!
//! | estimator | belief | needs of a model | allocates |
//! |-|-|-|-|
//! | [`Ekf`] | Gaussian, linear about its mean | `expected`, `jacobian`, `residual` | never |
//! | [`Ukf`] | Gaussian, quadratic about its mean | `expected`, `residual` | never |
//! | [`Ckf`] | Gaussian, exact to degree 3 | `expected`, `residual` | never |
//! | [`ParticleFilter`] | weighted cloud | `log_likelihoods`, `expected`, `residual` | once, when it is made, unless its size adapts |
//! | [`RaoBlackwellised`] | cloud of Gaussians | `expected`, `jacobian`, `residual` | at every step |
//!
//! The first three are one struct, [`Kalman`], over the one thing that tells them apart: how a
//! Gaussian goes through a map, a [`Transform`]. What is kept out is a [`Gate`]'s business; with
//! [`Iterations`] each update is linearised again about its own posterior.
//!
//! [`OutOfOrder`] lets any of them use observations that arrive late at their own time, and
//! [`rauch_tung_striebel`] smooths what Gaussian ones believed. Whether they know how good they
//! are is for [`consistency`] to say, and how good they can be for [`PosteriorCramerRao`].
//!
//! From all readings of one flight at once, [`ShadowingGrid`] locates a transmitter of unknown
//! power whose level fades alike in neighbouring places.
//!
//! The particle filter and the grid need the feature `alloc`; the rest runs without an allocator.

#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;

#[cfg(feature = "alloc")]
pub mod consistency;
mod count;
#[cfg(feature = "alloc")]
mod cramer_rao;
mod gaussian;
mod innovation;
mod kalman;
#[cfg(feature = "alloc")]
mod out_of_order;
#[cfg(feature = "alloc")]
mod particle;
#[cfg(feature = "alloc")]
mod shadowing_grid;
#[cfg(feature = "alloc")]
mod smoother;
mod transform;
mod triangle;

#[cfg(feature = "alloc")]
pub use cramer_rao::{CramerRaoError, FisherQuadrature, PosteriorCramerRao};
pub use gaussian::Gaussian;
pub use innovation::Innovation;
pub use kalman::{Ckf, Ekf, Gate, GateLimit, Iterations, Kalman, Ukf};
#[cfg(feature = "alloc")]
pub use out_of_order::OutOfOrder;
#[cfg(feature = "alloc")]
pub use particle::{KldSampling, ParticleFilter, RaoBlackwellised, Resampling};
#[cfg(feature = "alloc")]
pub use shadowing_grid::{
    Intercept, Marginal, PosteriorMap, ShadowingFix, ShadowingGrid, ShadowingGridConfig,
    ShadowingGridError, Slope,
};
#[cfg(feature = "alloc")]
pub use smoother::rauch_tung_striebel;
pub use transform::{Cubature, Image, Kappa, Map, Taylor, Transform, Unscented};
