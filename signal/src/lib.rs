//! Radio pulses: detected in complex samples, and given to the tags that sent them.

pub mod detector;
pub mod samples;

mod pulse;
pub mod tags;

pub use pulse::Pulse;
