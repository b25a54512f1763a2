//! Antennas.

#[cfg(feature = "std")]
mod config;
mod decibels;
#[cfg(feature = "std")]
mod error;
mod figures;
mod files;
mod formula;
mod gain;
mod learn;
mod multipath;
mod table;

#[cfg(feature = "std")]
pub use config::{AntennaConfig, CardioidConfig, GainRow, PatchConfig, SharedAntenna, YagiConfig};
#[cfg(feature = "std")]
pub use error::AntennaError;
pub use figures::MainLobe;
pub use files::{MsiFile, MsiUnit, PatternFileError, PatternFileReason};
pub use formula::{Cardioid, Dipole, Isotropic, Patch, Yagi};
pub use gain::Antenna;
pub use learn::{LearnPatternError, LearnedPattern, learn_pattern};
pub use multipath::{ReflectedWave, multipath_gain_dbi};
pub use table::{ElevationPattern, PatternTable, PatternTable3d, PatternTableError, PrincipalCuts};

use decibels::linear;
