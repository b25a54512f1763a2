//! Antennas whose gain is tabulated.

mod elevation_pattern;
mod error;
mod pattern_table;
mod pattern_table_3d;
mod principal_cuts;
mod reference_patch;
mod spline;

pub use elevation_pattern::ElevationPattern;
pub use error::PatternTableError;
pub use pattern_table::PatternTable;
pub use pattern_table_3d::PatternTable3d;
pub use principal_cuts::PrincipalCuts;

use super::{Antenna, linear};
