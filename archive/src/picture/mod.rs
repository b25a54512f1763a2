//! The picture of a hunt, of an antenna, and of the results of a campaign, as SVG.
//!
//! In a hunt's, East is to the right, North up, and a metre is as long in both directions.

mod canvas;
mod chart;
mod distributions;
mod frame;
mod label;
mod legend;
mod palette;
mod polar;
mod scene;

pub use canvas::PictureError;
pub use distributions::Distribution;

use foxhunt_sensors::Antenna;

use foxhunt_hunt::{hunt::Event, log::LogHeader};

/// Draws a hunt: where the drones listened, their bearings, how the estimates went, the last
/// of each beacon with its 95 % ellipse, and the beacons where they truly are, if the header
/// knows. Returns the text of an SVG file.
///
/// The events of a log draw the same picture as those of the hunt that wrote it. What is not
/// finite is left out; a hunt without events is an empty field.
///
/// # Errors
///
/// [`PictureError`] when the drawing library refuses an element.
pub fn hunt_svg(header: &LogHeader, events: &[Event]) -> Result<String, PictureError> {
    let scene = scene::Scene::new(header, events);
    let frame = frame::Frame::around(&scene.extent(), canvas::PLOT);
    canvas::svg(|canvas| {
        chart::draw(canvas, &frame, &scene)?;
        legend::draw(canvas, header, &scene)
    })
}

/// Draws an antenna: the cuts of azimuth and elevation through its main lobe, 40 dB deep. Returns
/// the text of an SVG file.
///
/// # Errors
///
/// [`PictureError`] when the drawing library refuses an element.
pub fn antenna_svg(name: &str, antenna: &dyn Antenna) -> Result<String, PictureError> {
    canvas::svg(|canvas| polar::draw(canvas, name, antenna))
}

/// Draws how the errors and the NEES of contenders are distributed, the latter beside χ² with two
/// degrees of freedom, which is that of a consistent estimator, and the band about it that holds
/// such a one's runs with 95 %. Returns the text of an SVG file.
///
/// # Errors
///
/// [`PictureError`] when the drawing library refuses an element.
pub fn distributions_svg(title: &str, contenders: &[Distribution]) -> Result<String, PictureError> {
    canvas::svg(|canvas| distributions::draw(canvas, title, contenders))
}

#[cfg(test)]
mod tests;
