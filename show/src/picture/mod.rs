//! Pictures of hunts, turns, antennas and campaigns, and graphs of what is in them, as SVG.
//!
//! In a hunt's, East is to the right, North up, and a metre is as long in both directions.

mod canvas;
mod chart;
mod distributions;
mod frame;
mod graph;
mod legend;
mod of_overview;
mod phases;
mod polar;
mod scene;

pub use canvas::PictureError;
pub use distributions::Distribution;
pub use distributions::Ratios;
pub use graph::{Axis, Band, Curve, Graph, Mark, Scale, Tint};
pub use of_overview::{NamedSearch, axes_over_steps, error_over_steps, nees_over_steps};

use foxhunt_formation::Phase;
use foxhunt_sensors::Antenna;

use foxhunt_hunt::{hunt::Event, log::LogHeader};

use crate::overview::{SearchOverview, Turn};

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

/// Draws curves over one axis. Returns the text of an SVG file.
///
/// # Errors
///
/// [`PictureError`] when the drawing library refuses an element.
pub fn graph_svg(graph: &Graph) -> Result<String, PictureError> {
    canvas::svg(|canvas| graph::draw(canvas, graph))
}

/// Draws a turn of the antenna: its samples, and its preprocessed pattern with the known antenna;
/// `bearing` in radians counter-clockwise from East is a ray in both. Returns the text of an SVG
/// file.
///
/// # Errors
///
/// [`PictureError`] when the drawing library refuses an element.
pub fn turn_svg(title: &str, turn: &Turn, bearing: Option<f64>) -> Result<String, PictureError> {
    canvas::svg(|canvas| polar::draw_turn(canvas, title, turn, bearing))
}

/// Draws the state machine of a search, from the transitions of
/// [`Phases`](foxhunt_formation::Phases) themselves. The phases of a hunt, in their order, add how
/// often it went each way. Returns the text of an SVG file.
///
/// # Errors
///
/// [`PictureError`] when the drawing library refuses an element.
pub fn phases_svg(title: &str, phases: Option<&[Phase]>) -> Result<String, PictureError> {
    canvas::svg(|canvas| phases::draw(canvas, title, phases))
}

/// Draws the cloud of a search at six moments from its beginning to its end. Returns the text of an
/// SVG file.
///
/// # Errors
///
/// [`PictureError`] when the drawing library refuses an element.
pub fn clouds_svg(title: &str, search: &SearchOverview) -> Result<String, PictureError> {
    canvas::svg(|canvas| chart::draw_clouds(canvas, title, search))
}

/// Draws how contenders compare with a reference, in each of some figures. Returns the text of an
/// SVG file.
///
/// # Errors
///
/// [`PictureError`] when the drawing library refuses an element.
pub fn ratios_svg(
    title: &str,
    figures: &[&str],
    contenders: &[Ratios],
) -> Result<String, PictureError> {
    canvas::svg(|canvas| distributions::draw_ratios(canvas, title, figures, contenders))
}

/// A picture as PNG, two pixels for each of the SVG's, with the sans-serif fonts of the system.
///
/// # Errors
///
/// [`PictureError`] for a text that is no SVG, or where there is no room for the picture.
#[cfg(feature = "png")]
pub fn png(svg: &str) -> Result<Vec<u8>, PictureError> {
    use resvg::{
        tiny_skia::{Pixmap, Transform},
        usvg::{Options, Tree},
    };

    const SCALE: f32 = 2.0;
    let mut options = Options::default();
    options.fontdb_mut().load_system_fonts();
    let tree = Tree::from_str(svg, &options).map_err(PictureError::new)?;
    let size = tree.size().to_int_size().scale_by(SCALE);
    let size = size.ok_or_else(|| PictureError::new("it has no size"))?;
    let pixmap = Pixmap::new(size.width(), size.height());
    let mut pixmap = pixmap.ok_or_else(|| PictureError::new("it is too large"))?;
    resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut pixmap.as_mut());
    pixmap.encode_png().map_err(PictureError::new)
}

#[cfg(test)]
mod tests;
