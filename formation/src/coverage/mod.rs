mod area;
mod cells;
mod sweep;
#[cfg(test)]
mod tests;

use area::Area;
pub use sweep::{Coverage, CoverageConfig, CoverageError};
