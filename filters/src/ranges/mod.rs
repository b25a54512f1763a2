//! Where ranges, or differences of ranges, meet.

mod differences;
mod multilateration;

pub use differences::{SlantRangeDifference, spherical_intersection};
pub use multilateration::{SlantRange, multilaterate};
