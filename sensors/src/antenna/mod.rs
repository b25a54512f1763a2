//! Antennas.

#[cfg(feature = "std")]
mod config;
mod formula;
mod gain;
mod learn;
mod msi;
mod pattern_file;
mod spline;
mod table;

#[cfg(feature = "std")]
pub use config::{
    AntennaConfig, AntennaError, CardioidConfig, GainRow, PatchConfig, SharedAntenna, YagiConfig,
};
pub use formula::{Cardioid, Dipole, Isotropic, Patch, Yagi};
pub use gain::{Antenna, MainLobe, ReflectedWave, multipath_gain_dbi};
pub use learn::{LearnPatternError, LearnedPattern, learn_pattern};
pub use msi::{MsiFile, MsiUnit};
pub use pattern_file::{PatternFileError, PatternFileReason};
pub use table::{ElevationPattern, PatternTable, PatternTable3d, PatternTableError, PrincipalCuts};
