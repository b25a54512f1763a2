//! Recordings and logs of foxhunt: readers, receptions, calibration, replay, pictures, exports.
//!
//! [`recording`] reads CSV files of other programs and our own; [`recorded`] makes receptions of
//! them, and fits path loss, bearing errors and antenna patterns; [`replay`] runs the receptions of
//! a log through an estimator again; [`relocation`] locates again from recordings; [`overview`]
//! puts together what there is to look at, [`page`] shows it in a browser, [`bag`] reads bags of
//! ROS 2, [`export`] writes it for other programs; [`movebank`] writes places that were found.

pub mod bag;
pub mod export;
pub mod movebank;
pub mod overview;
pub mod page;
#[cfg(feature = "pictures")]
pub mod picture;
pub mod raster;
pub mod recorded;
pub mod recording;
pub mod relocation;
pub mod replay;
pub mod struck;
