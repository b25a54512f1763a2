//! Localisation by ranges, or by differences of ranges.

mod differences;
mod multilateration;

pub use differences::{SlantRangeDifference, spherical_intersection};
pub use multilateration::{SlantRange, multilaterate, multilaterate_with_bias, range_bias_sigmas};
