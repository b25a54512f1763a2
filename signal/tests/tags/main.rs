//! Pulses given to tags: real lists and simulated ones.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::print_stdout,
    reason = "counts are small; a long test prints what it measures"
)]

mod recorded;
mod simulated;
