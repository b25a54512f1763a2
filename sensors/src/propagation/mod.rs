//! Laws of received power over range.

mod friis;
mod law;
mod log_distance;
mod two_ray;

pub use friis::Friis;
pub use law::Propagation;
pub use log_distance::LogDistance;
pub use two_ray::{Polarisation, TwoRay};

pub(crate) use law::{SQUARES, clamp, many_log_distance};
