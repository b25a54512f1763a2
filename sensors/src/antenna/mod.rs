//! Antennas.

#[cfg(feature = "std")]
mod config;
mod error;
mod gain;
mod pattern_table;
mod reference_patch;

#[cfg(feature = "std")]
pub use config::{AntennaConfig, GainRow, SharedAntenna};
pub use error::PatternTableError;
pub use gain::Antenna;
pub use pattern_table::PatternTable;
