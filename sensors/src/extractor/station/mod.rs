//! Fixed antennas that look several ways at once, as one coarse pattern.

mod extract;
mod lobe;
mod model;
mod pattern;

pub(crate) use extract::{LOST, TAIL};
pub(crate) use lobe::lobe_db;
pub use model::StationModel;
pub use pattern::{StationAntenna, StationPattern};
