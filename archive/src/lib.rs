//! Recordings and logs of foxhunt: readers, receptions, calibration, replay.
//!
//! [`recording`] reads CSV files of other programs and our own, and [`bag`] those of ROS 2;
//! [`recorded`] makes receptions of them, and fits path loss, bearing errors and antenna patterns;
//! [`replay`] runs the receptions of a log through an estimator again, without the ones that were
//! [`struck`] out; [`movebank`] writes places that were found.

pub mod bag;
pub mod movebank;
pub mod recorded;
pub mod recording;
pub mod replay;
pub mod struck;
