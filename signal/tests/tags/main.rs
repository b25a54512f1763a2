//! Pulses given to tags: real lists and simulated ones.

mod recorded;
mod simulated;
