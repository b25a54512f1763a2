//! Radio pulses: detected in complex samples, and given to the tags that sent them.

mod pulse;
pub mod tags;

pub use pulse::Pulse;
