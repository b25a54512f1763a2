//! Antennas whose gain is a formula.

mod cardioid;
mod dipole;
mod isotropic;
mod patch;
mod terms;
mod yagi;

pub use cardioid::Cardioid;
pub use dipole::Dipole;
pub use isotropic::Isotropic;
pub use patch::Patch;
pub use yagi::Yagi;

use super::{Antenna, figures::mean_over_sphere};
use terms::{back_lobe, decibels, direction, half_wave_dipole};
