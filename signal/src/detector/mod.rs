//! Pulses found in complex samples, at a rate of false alarms that the user sets.
//!
//! Samples are divided into channels, and each channel is searched by a bank of windows as long as
//! the pulses may be. What stands out is refined, strongest first, and passes if it is above the
//! threshold that the rate of false alarms gives, ends on both sides, and is neither part of a
//! stronger pulse nor of a burst over all frequencies.

mod bank;
mod channeliser;
mod config;
mod detection;
mod fold;
mod front;
mod noise;
mod refine;
mod resolve;
mod search;
mod threshold;

pub use config::{DetectorConfig, DetectorError};
pub use detection::Detection;
pub use fold::{FoldConfig, Train, TrainDetector};
pub use search::Detector;
