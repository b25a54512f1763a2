//! How received power falls with range.

mod friis;
mod law;
mod log_distance;

pub use friis::Friis;
pub use law::Propagation;
pub use log_distance::LogDistance;

pub(crate) use law::clamp;
