//! Recordings as people make them, drawn from seeds, each with its truth.
//!
//! A [`Class`] is a way of receiving with something about it that may go wrong: a drive of 40 km, a
//! receiver that clips, a house. [`Class::draw`] makes the files of one recording, in the formats
//! that `locate` and `judge` read, and the flags of the command that reads them. What propagates
//! and receives here is written apart and imports nothing from the packages of the estimators,
//! their models or the simulated world (`tests/layering.rs` sees to that): a mistake of theirs is
//! none of the judge's. One class in four cuts and thins real recordings, whose places are known.

mod bearings;
mod bound;
mod class;
mod cut;
mod geodesy;
mod levels;
mod mishaps;
mod moving;
mod radio;
mod random;
mod ranges;
mod scene;

pub use bound::{Bound, median_error};
pub use class::classes;
pub use scene::{Class, DrawnFile, DrawnRecording};
