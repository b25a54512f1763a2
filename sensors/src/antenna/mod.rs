//! Antennas.

#[cfg(feature = "std")]
mod config;
mod figures;
mod formula;
mod gain;
mod table;

#[cfg(feature = "std")]
pub use config::{AntennaConfig, GainRow, SharedAntenna};
pub use formula::{Cardioid, Dipole, Isotropic, Patch, Yagi};
pub use gain::{Antenna, MainLobe};
pub use table::{PatternTable, PatternTable3d, PatternTableError, PrincipalCuts};

use formula::linear;
