//! Measurement models: what a receiver at a known pose measures of a target in a given state.

mod bearing_mixture;
mod bearing_only;
mod censored;
mod columns;
mod differential_rss;
#[cfg(feature = "alloc")]
mod directional_level;
#[cfg(feature = "alloc")]
mod elevation;
mod level_bearing;
mod level_law;
mod magnetic_dipole;
mod over_terrain;
mod range_difference;
mod rss;
mod sight;
mod stacked;

pub use bearing_mixture::BearingMixture;
pub use bearing_only::BearingOnly;
pub use censored::Censored;
pub use differential_rss::DifferentialRss;
#[cfg(feature = "alloc")]
pub use directional_level::DirectionalLevel;
#[cfg(feature = "alloc")]
pub use elevation::WithElevationPattern;
pub use level_bearing::{FreePathLossRssBearing, FreePowerRssBearing, LevelBearing, RssBearing};
pub use level_law::{FreePathLoss, FreePower, LevelLaw};
pub use magnetic_dipole::MagneticDipole;
pub use over_terrain::OverTerrain;
pub use range_difference::RangeDifference;
pub use rss::Rss;
pub use stacked::Stacked;

use sight::Sight;
