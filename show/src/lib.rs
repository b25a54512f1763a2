//! Pages, pictures, rasters and exports of what foxhunt found.
//!
//! [`overview`] puts together what there is to look at, of a log or of recordings; [`page`] shows it
//! in a browser, [`picture`] draws it, [`raster`] lays it on a grid, [`export`] writes it for other
//! programs. [`relocation`] locates again from recordings, when somebody strikes out what was
//! received.

pub mod export;
pub mod overview;
pub mod page;
#[cfg(feature = "pictures")]
pub mod picture;
pub mod raster;
pub mod relocation;
