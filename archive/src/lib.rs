//! Recordings and logs of foxhunt: readers, receptions, calibration, replay, pictures.
//!
//! [`recording`] reads CSV files of other programs and our own; [`recorded`] makes receptions of
//! them, and fits path loss, bearing errors and antenna patterns; [`replay`] runs the receptions of
//! a log through an estimator again; [`movebank`] writes places that were found.

pub mod movebank;
#[cfg(feature = "pictures")]
pub mod picture;
pub mod recorded;
pub mod recording;
pub mod replay;
