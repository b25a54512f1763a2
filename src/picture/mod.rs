//! The picture of a hunt, as SVG.
//!
//! East is to the right, North up, and a metre is as long in both directions.

mod canvas;
mod chart;
mod frame;
mod label;
mod legend;
mod palette;
mod scene;

pub use canvas::PictureError;

use crate::{hunt::Event, log::LogHeader};

/// Draws a hunt: where the drones listened and what they heard, how the estimates went, the last
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

#[cfg(test)]
mod tests;
