//! Localisation of a transmitter of unknown power, from many spatially correlated readings at once.
//!
//! The readings, thinned along the path, are `value_i = a + b x_i(cell) + c g_i(cell) + e_i` with
//! e ~ N(0, σ² C): neighbours fade together (Gudmundson 1991). On every cell of a grid a and σ
//! are integrated out in closed form (Handcock & Stein 1993), b, c and the correlation by sums;
//! what remains is the posterior of the target's place, an average over all these explanations
//! by their evidence.

mod cells;
mod censored;
mod coefficient;
mod config;
mod explanations;
mod grid;
mod likelihood;
mod locate;
mod path;
mod regression;
mod search;

pub use coefficient::Marginal;
pub use config::{Intercept, PlacePrior, ShadowingGridConfig, ShadowingGridError, Slope};
pub use grid::PosteriorMap;
#[cfg(feature = "batch")]
pub(crate) use locate::bounds;
pub use locate::{ShadowingFix, ShadowingGrid};
pub use path::{Censoring, ShadowedReading};

/// Right-hand sides that are solved side by side: their sums fill the vector registers.
const LANES: usize = 16;

/// One row of [`LANES`] right-hand sides.
type Row = [f64; LANES];

/// Earlier readings that each reading is conditioned on, at most: the correlation e^(−d/ℓ) has
/// little memory beyond the nearest.
const NEIGHBOURS: usize = 12;

#[cfg(feature = "field-map")]
pub(crate) use path::{Path, Segments, Summary};
#[cfg(feature = "batch")]
pub(crate) use {
    coefficient::Mixture,
    grid::Grid,
    search::{Search, climb},
};
