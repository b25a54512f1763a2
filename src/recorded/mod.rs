//! What is made of recorded flights: bearings of turns, a transmitter's place, its path loss, an
//! antenna's pattern.

mod antenna;
mod bearing;
mod bearing_errors;
mod calibrate;
mod error;
mod observe;
mod selection;
mod station;
mod truth;

pub use antenna::{KnownDirection, learn_antenna};
pub use bearing::{BearingReading, LOW_CONFIDENCE, bearings};
pub use bearing_errors::{BearingsFit, calibrate_bearings};
pub use calibrate::{CalibrateConfig, Calibration, calibrate};
pub use error::RecordedError;
pub use observe::{ObserveConfig, observations};
pub use selection::{Selection, only_beacon};
pub use station::{
    CrossValidation, StationCalibration, StationConfig, fit_boresights, station_boresights,
};
pub use truth::recorded_truth;
