//! Place or track of a transmitter from all its receptions at once.

#[cfg(feature = "batch")]
mod absence;
mod area;
#[cfg(feature = "batch")]
mod batch;
#[cfg(feature = "batch")]
mod bearings;
mod clocks;
mod config;
#[cfg(feature = "batch")]
mod differences;
mod error;
mod examination;
#[cfg(feature = "maps")]
mod field_map;
#[cfg(feature = "batch")]
mod least_absolute;
mod located;
#[cfg(feature = "batch")]
mod moving;
mod parts;
mod path;
#[cfg(feature = "batch")]
mod ranges;
mod region;
mod searched;
mod shadowing_grid;
mod strongest;
#[cfg(feature = "batch")]
mod unknown_number;

#[cfg(feature = "batch")]
pub use absence::Absence;
pub(crate) use area::{Area, FREE_POWER_SIGMA_DB, extent_m, reference_power};
#[cfg(feature = "batch")]
pub(crate) use batch::MultiStart;
#[cfg(feature = "batch")]
pub(crate) use bearings::{ClosedForm, Lenth, Posterior, RepeatedMedian};
#[cfg(feature = "batch")]
pub use bearings::{LearnedSigma, learn_bearing_sigma};
pub use clocks::{ClockSearch, Clocks, ClocksUnknown, FoundOffset, HeardLevel};
pub use config::{CalibratedPower, Height, Listener, LocateConfig, Power};
#[cfg(feature = "batch")]
pub(crate) use differences::RangeDifferences;
pub use error::LocateError;
pub use examination::{Measurand, Residual};
pub(crate) use examination::{Uses, examine, residuals};
#[cfg(feature = "maps")]
pub(crate) use field_map::HighestOnMap;
#[cfg(feature = "batch")]
pub(crate) use least_absolute::LeastAbsolute;
pub(crate) use located::receiver_sigma_m;
pub use located::{CommonErrors, Explanation, Located, Locator, RangeBias, Rival, StationError};
#[cfg(feature = "batch")]
pub use moving::{Tracked, TrackingConfig, left_out, track, track_watched};
pub(crate) use path::{AtEnds, Paths};
#[cfg(feature = "batch")]
pub(crate) use ranges::Multilateration;
pub use region::Region;
pub use searched::{NextPlace, RangeSearched, Searched};
pub(crate) use shadowing_grid::CorrelatedShadowing;
pub(crate) use strongest::{Strongest, WeightedCentroid};
#[cfg(feature = "batch")]
pub use unknown_number::{Transmitter, Transmitters};

use foxhunt_core::elementary;
use nalgebra::Vector3;

/// Level in dB, `way` from a transmitter of 0 dBm at one metre, if the exponent is 1. Nearer than a
/// metre the law has no meaning.
fn loss_db(way: &Vector3<f64>) -> f64 {
    -5.0 / std::f64::consts::LN_10 * elementary::ln(way.norm_squared().max(1.0))
}
