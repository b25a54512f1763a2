//! From bursts of a transmitter whose place is known to a station's coarse pattern.

mod fit;
mod floor;
mod shape;

pub use fit::{StationBurst, StationFit, fit_station};
