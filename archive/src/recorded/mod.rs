//! Bearings of turns, receptions, path loss and antenna patterns out of recorded flights.

mod antennas;
mod bearing_errors;
mod calibrate;
mod receptions;
mod residual;
mod selection;
mod station;

pub use antennas::{
    ArrayCalibration, KnownDirection, calibrate_array, correct_arrays, has_several_beacons,
    is_fixed_array, learn_antenna,
};
pub use bearing_errors::{BearingsFit, bearing_errors, calibrate_bearings, true_bearing};
pub use calibrate::{CalibrateConfig, Calibration, KnownRange, calibrate, known_ranges};
pub use receptions::{BearingReading, LOW_CONFIDENCE, bearings};
pub use receptions::{
    GNSS_SIGMA_M, ReceptionConfig, RecordedReception, RecordedReceptions, listeners, receptions,
    recorded_receptions,
};
pub use residual::{RowResidual, row_name};
pub use selection::{
    RecordedError, Selection, only_beacon, recorded_truth, recorded_way, truth_at,
};
pub use station::{
    CrossValidation, StationCalibration, StationConfig, StationsCalibration, fit_boresights,
    station_boresights,
};
