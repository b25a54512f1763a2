//! From bursts of a transmitter whose place is known to the coarse patterns of stations.

mod fit;
mod floor;
mod lobe;
mod pool;
mod shape;

pub use fit::{StationBurst, StationDoubt, StationFit, StationRecord, StationsFit, fit_stations};
