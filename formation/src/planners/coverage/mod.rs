mod area;
mod cells;
mod error;
mod sweep;
#[cfg(test)]
mod tests;

use area::Area;
pub use error::CoverageError;
pub use sweep::{Coverage, CoverageConfig};
