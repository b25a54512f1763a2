//! From bursts of a transmitter whose place is known to the coarse patterns of stations.

mod burst;
mod fit;
mod floor;
mod lobe;
mod pool;
mod shape;

pub use burst::{StationBurst, StationRecord};
pub use fit::{StationDoubt, StationFit, StationsFit, fit_stations};
