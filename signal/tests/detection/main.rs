//! The detector in synthetic noise and on recordings.

mod air;
mod crowded;
mod recorded;
mod single;
