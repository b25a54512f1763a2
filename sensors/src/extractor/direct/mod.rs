//! Bearings read off a turn by an antenna of which no more is known than that it has a main lobe.

mod first_harmonic;
mod main_lobe;
mod maximum;

pub use first_harmonic::FirstHarmonic;
pub use main_lobe::MainLobeFit;
pub use maximum::Maximum;
