//! What recordings with a known transmitter taught: a file that the other commands take.

mod apply;
mod bearings;
mod error;
mod file;
mod sections;

pub use bearings::BearingCalibration;
pub use error::CalibrationFileError;
pub use file::{CALIBRATION_VERSION, CalibrationFile};
pub use sections::{BearingSection, PathLossSection, StationAntennaSection, StationSection};
