//! The hunt on real devices, or on the same devices emulated.

mod mission;

pub use mission::{Ending, FlightRules, Mission, MissionError};
