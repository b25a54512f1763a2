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
pub use area::{Area, FREE_POWER_SIGMA_DB, extent_m, reference_power};
#[cfg(feature = "batch")]
pub use batch::MultiStart;
#[cfg(feature = "batch")]
pub use bearings::{ClosedForm, Lenth, Posterior, RepeatedMedian};
#[cfg(feature = "batch")]
pub use bearings::{LearnedSigma, learn_bearing_sigma};
pub use clocks::{ClockSearch, Clocks, ClocksUnknown, FoundOffset, HeardLevel};
pub use config::{CalibratedPower, Centroid, FREQUENCY_MHZ, Height, Listener, LocateConfig, Power};
#[cfg(feature = "batch")]
pub use differences::RangeDifferences;
pub use error::LocateError;
pub use examination::{Measurand, Residual};
pub use examination::{Uses, examine, residuals};
#[cfg(feature = "maps")]
pub use field_map::HighestOnMap;
#[cfg(feature = "batch")]
pub use least_absolute::LeastAbsolute;
pub use located::receiver_sigma_m;
pub use located::{CommonErrors, Explanation, Located, Locator, RangeBias, Rival, StationError};
#[cfg(feature = "batch")]
pub use moving::{Tracked, TrackingConfig, left_out, track, track_watched};
pub use path::{AtEnds, Paths};
#[cfg(feature = "batch")]
pub use ranges::Multilateration;
pub use region::Region;
pub use searched::{NextPlace, RangeSearched, Searched};
pub use shadowing_grid::CorrelatedShadowing;
pub use strongest::{Strongest, WeightedCentroid};
#[cfg(feature = "batch")]
pub use unknown_number::{Transmitter, Transmitters};

use foxhunt_core::elementary;
use nalgebra::Vector3;

/// The cosine below which a dipole's null is filled, by the airframe's and the ground's
/// reflections: 20 dB below the maximum.
const NULL: f64 = 0.1;

/// 10 log₁₀ x = 2 · this · ln x, and 10 log₁₀ d = this · ln d².
const HALF_DB: f64 = 5.0 / std::f64::consts::LN_10;

/// Square of the range in m² below which levels rise no more: that of a millimetre.
const LEAST_SQUARE: f64 = 1e-6;

/// Level in dB, `way` from a transmitter of 0 dBm at one metre, if the exponent is 1. Nearer than a
/// metre the law has no meaning.
fn loss_db(way: &Vector3<f64>) -> f64 {
    -HALF_DB * elementary::ln(way.norm_squared().max(1.0))
}

/// Returns the level in dB of a transmitter of 0 dBm at one metre with an exponent of 1, and the
/// gain of one vertical dipole, `way` away from a receiver whose place has the variance
/// `own_square` in m².
fn loss_and_dipole(way: &Vector3<f64>, own_square: f64) -> [f64; 2] {
    // The mean of ln d² over the receiver's own error has no pole at the receiver.
    let square = (way.norm_squared() + own_square).max(LEAST_SQUARE);
    let cosine_square = way.xy().norm_squared() / square;
    [-HALF_DB * elementary::ln(square), 2.0 * HALF_DB * elementary::ln(cosine_square + NULL * NULL)]
}
