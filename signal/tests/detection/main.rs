//! The detector in synthetic noise and on recordings.
#![expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::print_stdout,
    reason = "counts are small, samples are f32, and a test prints what it skipped or measured"
)]

mod air;
mod crowded;
mod folded;
mod prompt;
mod recorded;
mod single;
