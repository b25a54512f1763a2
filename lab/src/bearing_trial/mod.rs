//! Simulated turns of an antenna, and what the extractors make of them.
//!
//! No drone flies: each turn has its transmitter and its nose in newly drawn directions, 6 readings
//! of 2 dB along each boresight, and what the case is named for. Every extractor reads the same
//! turns.

mod campaign;
mod case;
mod report;
mod turn;

pub use campaign::{BearingCampaignError, bearing_campaign};
pub use case::{BearingCase, bearing_case_named, bearing_cases};
pub use report::{BearingReport, ExtractorReport};

use turn::Turn;
