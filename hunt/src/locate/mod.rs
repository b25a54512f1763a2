//! Where a still transmitter is, from all that was received of it at once.

mod area;
#[cfg(feature = "batch")]
mod batch;
#[cfg(feature = "batch")]
mod bearings;
mod config;
mod error;
#[cfg(feature = "maps")]
mod field_map;
mod located;
#[cfg(feature = "batch")]
mod ranges;
mod shadowing_grid;

pub(crate) use area::{Area, FREE_EXPONENT, FREE_POWER_SIGMA_DB, reference_power};
#[cfg(feature = "batch")]
pub(crate) use batch::MultiStart;
#[cfg(feature = "batch")]
pub(crate) use bearings::{ClosedForm, Lenth, RepeatedMedian};
pub use config::{LocateConfig, Power};
pub use error::LocateError;
#[cfg(feature = "maps")]
pub(crate) use field_map::HighestOnMap;
pub use located::{Located, Locator, Rival};
#[cfg(feature = "batch")]
pub(crate) use ranges::{Multilateration, RangeDifferences};
pub(crate) use shadowing_grid::CorrelatedShadowing;
