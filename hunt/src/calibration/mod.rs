//! Calibrations: path loss, errors of bearings and station antennas, as files that commands take.

mod bearings;
mod error;
mod file;
mod sections;

pub use bearings::BearingCalibration;
pub use error::CalibrationFileError;
pub use file::{CALIBRATION_VERSION, CalibrationFile};
pub use sections::{
    BearingSection, PathLossSection, StationAntennaSection, StationPlace, StationSection,
};
