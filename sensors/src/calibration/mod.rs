//! Calibration of models and bearings by readings of a known transmitter.

mod calibrated;
mod deviation;
mod offset;
mod path_loss;
mod sigma;
#[cfg(feature = "alloc")]
mod station;
mod statistics;

pub use calibrated::{AtSite, Calibrated, Site, heading_towards};
pub use deviation::{Deviation, DeviationFit, MOST_HARMONICS, fit_deviation};
pub use offset::{BearingOffset, BearingOffsetFit, KnownBearing, OffsetTerms, fit_bearing_offset};
pub use path_loss::{CalibrationError, PathLossFit, fit_log_distance};
pub use sigma::{BearingError, SigmaFit, fit_sigma};
#[cfg(feature = "alloc")]
pub use station::{
    StationBurst, StationDoubt, StationFit, StationRecord, StationsFit, fit_stations,
};
pub use statistics::{Correlation, HARMONIC_PATTERN_UNKNOWNS, unexplained_by_harmonics};
