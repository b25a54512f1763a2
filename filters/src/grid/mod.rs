//! Recursive Bayes over the cells of an area.

mod blur;
mod columns;
mod config;
mod estimator;
mod filter;
mod lattice;
mod likelihood;
mod motion;
mod reading;
mod weights;
mod window;

pub use config::{GridConfig, NoiseScales};
pub use filter::GridFilter;

#[cfg(feature = "batch")]
pub(crate) use blur::blur;

use columns::Columns;
use lattice::Lattice;
use likelihood::{Likelihood, Pool};
use weights::Weights;
use window::Window;
