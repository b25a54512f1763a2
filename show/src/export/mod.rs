//! Places, bearings, ellipses, regions and paths in the formats of other programs: GeoJSON, KML,
//! CZML, GPX, CSV, Cursor on Target, and MCAP with messages of ROS 2 (feature
//! `mcap`); beliefs as GeoTIFF, as an overlay of KML, as a picture and as MBTiles (feature
//! `sqlite`). A hunt that goes on has a [`CotFeed`] for teams, and an [`MqttFeed`] for Home
//! Assistant and Node-RED.
//!
//! Coordinates are WGS84. Heights are left out where a format does without: those of local frames
//! are above the frame's origin, whose own height is often not known.

mod cot;
mod cot_feed;
mod czml;
mod error;
mod feature;
mod geotiff;
mod gpx;
mod kml;
#[cfg(feature = "sqlite")]
mod mbtiles;
#[cfg(feature = "mcap")]
mod mcap;
mod mqtt_feed;
mod paint;
mod table;
mod xml;

pub use cot::CotPlatform;
pub use cot_feed::{CotEvent, CotFeed};
pub use error::{ExportError, Format};
pub use mqtt_feed::{MqttFeed, MqttMessage, availability_topic};

use foxhunt_wire::geodesy::LocalFrame;

use crate::overview::Overview;

/// The bytes of a file in a format.
///
/// # Errors
///
/// [`ExportError`] where the format needs an origin or a time that the overview does not have.
pub fn export(overview: &Overview, format: Format) -> Result<Vec<u8>, ExportError> {
    format.check(overview.frame.is_some(), overview.epoch_unix_s.is_some())?;
    let frame = || overview.frame.ok_or(ExportError::NoOrigin);
    match format {
        Format::GeoJson => feature::write_geojson(overview, &frame()?),
        Format::Kml => kml::write(overview, &frame()?),
        Format::Czml => czml::write(overview, &frame()?),
        Format::Gpx => gpx::write(overview, &frame()?),
        Format::Csv => table::write(overview),
        Format::Cot => cot::write(overview, &frame()?),
        Format::Mcap => mcap_of(overview, &frame()?),
        Format::GeoTiff => geotiff::write(overview, &frame()?),
        Format::Kmz => kml::write_overlay(overview, &frame()?),
        Format::MbTiles => tiles_of(overview, &frame()?),
        Format::Png => {
            let paint = paint::Paint::of(overview).ok_or(ExportError::NoBelief)?;
            paint::png(&paint).map_err(ExportError::write)
        }
    }
}

#[cfg(feature = "sqlite")]
fn tiles_of(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    mbtiles::write(overview, frame)
}

#[cfg(not(feature = "sqlite"))]
fn tiles_of(_: &Overview, _: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    Err(ExportError::NoTiles)
}

#[cfg(feature = "mcap")]
fn mcap_of(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    mcap::write(overview, frame)
}

#[cfg(not(feature = "mcap"))]
fn mcap_of(_: &Overview, _: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    Err(ExportError::NotBuilt)
}

#[cfg(test)]
mod tests;
