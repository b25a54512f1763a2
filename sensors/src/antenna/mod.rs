//! Antennas.

mod error;
mod pattern_table;
mod reference_patch;

pub use error::PatternTableError;
pub use pattern_table::PatternTable;
