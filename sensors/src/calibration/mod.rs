//! Calibration of models and bearings by readings of a known transmitter.

mod calibrated;
mod correlation;
mod deviation;
mod error;
mod fit;
mod harmonic_pattern;
mod offset;
mod sigma;
mod site;
#[cfg(feature = "alloc")]
mod station;
mod student;

pub use calibrated::{Calibrated, heading_towards};
pub use correlation::Correlation;
pub use deviation::{Deviation, DeviationFit, MOST_HARMONICS, fit_deviation};
pub use error::CalibrationError;
pub use fit::{PathLossFit, fit_log_distance};
pub use harmonic_pattern::{HARMONIC_PATTERN_UNKNOWNS, unexplained_by_harmonics};
pub use offset::{BearingOffset, BearingOffsetFit, KnownBearing, OffsetTerms, fit_bearing_offset};
pub use sigma::{BearingError, SigmaFit, fit_sigma};
pub use site::{AtSite, Site};
#[cfg(feature = "alloc")]
pub use station::{
    StationBurst, StationDoubt, StationFit, StationRecord, StationsFit, fit_stations,
};
