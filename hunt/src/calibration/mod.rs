//! Calibrations: path loss, errors of bearings and station antennas, as files that commands take.

mod arrays;
mod conformal;
mod file;
mod sections;

pub use arrays::ArraySection;
pub use conformal::{
    CONFORMAL_VERSION, ConformalError, ConformalFactors, ConformalFile, ConformalRegions,
    Deviation, LEAST_CONFORMAL_FIXES,
};
pub use file::{CALIBRATION_VERSION, CalibrationFile, CalibrationFileError};
pub use sections::{
    BearingCalibration, BearingSection, PathLossSection, StationAntennaSection,
    StationModelSection, StationPlace, StationSection,
};
