//! What a receiver measures, and what can be made of it.
//!
//! | what | here |
//! |-|-|
//! | how power falls with range | [`Propagation`]: [`LogDistance`], [`Friis`] |
//! | what a receiver expects | [`Rss`], [`BearingOnly`], [`RssBearing`], [`FreePowerRssBearing`], [`FreePathLossRssBearing`] |
//! | what two receivers' difference tells | [`DifferentialRss`], [`RangeDifference`] |
//! | two models at once; what silence tells | [`Stacked`]; [`Censored`] |
//! | how bearings err | [`BearingMixture`] |
//! | a turn of the antenna, put in order | [`Pattern`] |
//! | from a turn to level and bearing | [`Pritzl2018`]; [`Maximum`], [`FirstHarmonic`], [`MainLobe`]; with a known antenna [`CrossCorrelation`], [`MaximumLikelihood`] (`alloc`) |
//! | what the transmitter's law is | [`fit_log_distance`] |
//! | an antenna's gain over direction | [`Antenna`]: [`PatternTable`] (`alloc`) |
//! | an antenna on a stepper | [`StepperSource`] (`alloc`) |
//!
//! Conventions are those of [`foxhunt_core`]: metres, seconds, radians counter-clockwise from
//! East, dBm. Without features nothing here allocates.

#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

#[cfg(feature = "alloc")]
mod antenna;
mod calibration;
mod extractor;
mod models;
mod parameter;
mod propagation;
#[cfg(feature = "alloc")]
mod stepper;

#[cfg(feature = "alloc")]
pub use antenna::{Antenna, PatternTable, PatternTableError};
#[cfg(feature = "std")]
pub use antenna::{AntennaConfig, GainRow, SharedAntenna};
pub use calibration::{CalibrationError, PathLossFit, fit_log_distance};
pub use extractor::{Cell, Pattern, Pritzl2018, resultant_confidence};
#[cfg(feature = "alloc")]
pub use extractor::{
    CrossCorrelation, FirstHarmonic, MainLobe, Maximum, MaximumLikelihood, Residuals,
};
pub use models::{
    BearingMixture, BearingOnly, Censored, DifferentialRss, FreePathLossRssBearing,
    FreePowerRssBearing, RangeDifference, Rss, RssBearing, Stacked,
};
pub use parameter::ParameterError;
pub use propagation::{Friis, LogDistance, Propagation};
#[cfg(feature = "alloc")]
pub use stepper::{StepperConfig, StepperError, StepperSource};
