//! Antennas.

#[cfg(feature = "std")]
mod config;
mod figures;
mod formula;
mod gain;
mod learn;
mod table;

#[cfg(feature = "std")]
pub use config::{AntennaConfig, GainRow, SharedAntenna};
pub use formula::{Cardioid, Dipole, Isotropic, Patch, Yagi};
pub use gain::{Antenna, MainLobe};
pub use learn::{LearnPatternError, LearnedPattern, learn_pattern};
pub use table::{PatternTable, PatternTable3d, PatternTableError, PrincipalCuts};

use formula::linear;
