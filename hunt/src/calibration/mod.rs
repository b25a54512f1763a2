//! Calibrations: path loss, errors of bearings and station antennas, as files that commands take.

mod arrays;
mod bearings;
mod conformal;
mod error;
mod file;
mod sections;

pub use arrays::ArraySection;
pub use bearings::BearingCalibration;
pub use conformal::{
    CONFORMAL_VERSION, ConformalError, ConformalFactors, ConformalFile, ConformalRegions,
    Deviation, LEAST_CONFORMAL_FIXES,
};
pub use error::CalibrationFileError;
pub use file::{CALIBRATION_VERSION, CalibrationFile};
pub use sections::{
    BearingSection, PathLossSection, StationAntennaSection, StationModelSection, StationPlace,
    StationSection,
};
