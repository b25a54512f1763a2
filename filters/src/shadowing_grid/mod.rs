//! Where a transmitter of unknown power is, from many spatially correlated readings at once.
//!
//! The readings, thinned along the path, are `value_i = a + b x_i(cell) + e_i` with
//! e ~ N(0, σ² C): neighbours fade together (Gudmundson 1991). On every cell of a grid a and σ
//! are integrated out in closed form (Handcock & Stein 1993), b and the correlation length by
//! sums; what remains is the posterior of the target's place.

mod config;
mod error;
mod fix;
mod grid;
mod likelihood;
mod locate;
mod marginal;
mod path;
mod regression;
mod whitener;

pub use config::{Intercept, ShadowingGridConfig, Slope};
pub use error::ShadowingGridError;
pub use fix::ShadowingFix;
pub use grid::PosteriorMap;
pub use locate::ShadowingGrid;
pub use marginal::Marginal;

#[cfg(feature = "batch")]
#[cfg(feature = "field-map")]
pub(crate) use {grid::Grid, path::Segments};
