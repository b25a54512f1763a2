//! What is made of recorded flights: bearings of turns, a transmitter's place, its path loss.

mod bearing;
mod calibrate;
mod error;
mod observe;
mod selection;
mod truth;

pub use bearing::{BearingReading, LOW_CONFIDENCE, bearings};
pub use calibrate::{CalibrateConfig, Calibration, calibrate};
pub use error::RecordedError;
pub use observe::{ObserveConfig, observations};
pub use selection::{Selection, only_beacon};
pub use truth::recorded_truth;
