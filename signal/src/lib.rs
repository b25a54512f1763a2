//! Radio pulses: detected in complex samples, and given to the tags that sent them.

pub mod detector;
pub mod samples;

mod pulse;
pub mod tags;
mod waterfall;

pub use pulse::Pulse;
pub use rustfft::num_complex::Complex32;
pub use waterfall::{Waterfall, WaterfallRow};
