//! Bearings of turns, receptions, path loss and antenna patterns out of recorded flights.

mod antenna;
mod arrays;
mod bearing;
mod bearing_errors;
mod calibrate;
mod error;
mod listeners;
mod receptions;
mod residual;
mod selection;
mod station;
mod truth;

pub use antenna::{KnownDirection, learn_antenna};
pub use arrays::{
    ArrayCalibration, calibrate_array, correct_arrays, has_several_beacons, is_fixed_array,
};
pub use bearing::{BearingReading, LOW_CONFIDENCE, bearings};
pub use bearing_errors::{BearingsFit, bearing_errors, calibrate_bearings, true_bearing};
pub use calibrate::{CalibrateConfig, Calibration, KnownRange, calibrate, known_ranges};
pub use error::RecordedError;
pub use listeners::listeners;
pub use receptions::{
    GNSS_SIGMA_M, ReceptionConfig, RecordedReception, RecordedReceptions, receptions,
    recorded_receptions,
};
pub use residual::{RowResidual, row_name};
pub use selection::{Selection, only_beacon};
pub use station::{
    CrossValidation, StationCalibration, StationConfig, StationsCalibration, fit_boresights,
    station_boresights,
};
pub use truth::{recorded_truth, recorded_way, truth_at};
