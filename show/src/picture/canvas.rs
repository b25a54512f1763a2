//! Canvas that pictures are drawn on, and its colours.

use std::fmt::Display;

use plotters::{
    backend::SVGBackend,
    coord::Shift,
    drawing::{DrawingArea, IntoDrawingArea},
    element::{Circle, DashedPathElement, PathElement, Polygon, Rectangle, Text},
    style::{
        Color, IntoFont, RGBAColor, RGBColor, ShapeStyle, TextStyle,
        text_anchor::{HPos, Pos, VPos},
    },
};

use super::frame::{Pixel, Rect};

/// The colours of the drones, distinct with any colour vision (Okabe & Ito 2008).
const DRONES: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 130, 0),
    RGBColor(0, 158, 115),
    RGBColor(86, 180, 233),
    RGBColor(204, 121, 167),
    RGBColor(140, 110, 30),
];

/// A drone's colour; with more drones than colours they come again.
pub(super) fn drone_colour(index: usize) -> RGBColor {
    DRONES[index % DRONES.len()]
}

/// Colour of beliefs.
pub(super) const BELIEF: RGBColor = RGBColor(200, 20, 60);
/// The places of a belief's cloud.
pub(super) const CLOUD: RGBColor = RGBColor(235, 120, 140);
/// Colour of the truth and of text.
pub(super) const INK: RGBColor = RGBColor(25, 25, 30);
/// Text of less weight.
pub(super) const FAINT_INK: RGBColor = RGBColor(95, 95, 105);
/// The lines of the grid.
pub(super) const GRID: RGBColor = RGBColor(228, 230, 234);
/// The frame about the field.
pub(super) const EDGE: RGBColor = RGBColor(150, 150, 158);
/// Paper.
pub(super) const PAPER: RGBColor = RGBColor(255, 255, 255);

/// The backend knows whole units only: four in a pixel make smooth curves.
pub(super) const UNIT: i32 = 4;

const WIDTH: i32 = 1120 * UNIT;
const HEIGHT: i32 = 860 * UNIT;

/// Rectangle of the field.
pub(super) const PLOT: Rect =
    Rect { left: 64 * UNIT, top: 56 * UNIT, right: 870 * UNIT, bottom: 802 * UNIT };

/// Rectangle of the legend.
pub(super) const LEGEND: Rect =
    Rect { left: 892 * UNIT, top: 56 * UNIT, right: 1108 * UNIT, bottom: 802 * UNIT };

/// Runs `draw` on an empty canvas and returns the SVG.
pub(super) fn svg(
    draw: impl FnOnce(&Canvas<'_>) -> Result<(), PictureError>,
) -> Result<String, PictureError> {
    let mut text = String::new();
    {
        let size = (WIDTH.unsigned_abs(), HEIGHT.unsigned_abs());
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        let canvas = Canvas { root };
        canvas.root.fill(&PAPER).map_err(PictureError::new)?;
        draw(&canvas)?;
        canvas.root.present().map_err(PictureError::new)?;
    }
    // The units are finer than the pixels that it is to be shown with.
    let fine = format!("width=\"{WIDTH}\" height=\"{HEIGHT}\"");
    let shown = format!("width=\"{}\" height=\"{}\"", WIDTH / UNIT, HEIGHT / UNIT);
    Ok(text.replacen(&fine, &shown, 1))
}

/// Drawing surface: lines, dots and text in canvas units; line widths, radii and text sizes in
/// quarters of a pixel too.
pub(super) struct Canvas<'a> {
    root: DrawingArea<SVGBackend<'a>, Shift>,
}

/// Part of a text that is at the given place.
#[derive(Clone, Copy, Debug)]
pub(super) enum Anchor {
    /// The middle of its left edge.
    Left,
    /// The middle of its right edge.
    Right,
    /// The middle of its top edge.
    Top,
}

impl Canvas<'_> {
    pub(super) fn line(
        &self,
        points: Vec<Pixel>,
        colour: RGBAColor,
        width: i32,
    ) -> Result<(), PictureError> {
        self.root.draw(&PathElement::new(points, stroke(colour, width))).map_err(PictureError::new)
    }

    pub(super) fn dashes(
        &self,
        points: Vec<Pixel>,
        colour: RGBAColor,
        width: i32,
    ) -> Result<(), PictureError> {
        let dash = DashedPathElement::new(points, 4 * UNIT, 4 * UNIT, stroke(colour, width));
        self.root.draw(&dash).map_err(PictureError::new)
    }

    pub(super) fn area(&self, corners: Vec<Pixel>, colour: RGBAColor) -> Result<(), PictureError> {
        self.root.draw(&Polygon::new(corners, colour.filled())).map_err(PictureError::new)
    }

    /// A rectangle without an edge.
    pub(super) fn cover(&self, rect: Rect, colour: RGBAColor) -> Result<(), PictureError> {
        let corners = [(rect.left, rect.top), (rect.right, rect.bottom)];
        self.root.draw(&Rectangle::new(corners, colour.filled())).map_err(PictureError::new)
    }

    pub(super) fn dot(
        &self,
        at: Pixel,
        radius: i32,
        colour: RGBAColor,
    ) -> Result<(), PictureError> {
        self.root.draw(&Circle::new(at, radius, colour.filled())).map_err(PictureError::new)
    }

    /// A star of five points with a white edge.
    pub(super) fn star(
        &self,
        at: Pixel,
        radius: i32,
        colour: RGBAColor,
    ) -> Result<(), PictureError> {
        let point = |i: u32, radius: f64| {
            let angle = std::f64::consts::PI * (f64::from(i) / 5.0 - 0.5);
            let reach = if i.is_multiple_of(2) { radius } else { 0.42 * radius };
            (
                at.0 + super::frame::whole(reach * libm::cos(angle)),
                at.1 + super::frame::whole(reach * libm::sin(angle)),
            )
        };
        for (radius, colour) in [(radius + 2 * UNIT, PAPER.mix(0.9)), (radius, colour)] {
            self.area((0..10).map(|i| point(i, f64::from(radius))).collect(), colour)?;
        }
        Ok(())
    }

    pub(super) fn text(
        &self,
        text: &str,
        at: Pixel,
        size: i32,
        colour: RGBColor,
        anchor: Anchor,
    ) -> Result<(), PictureError> {
        let pos = match anchor {
            Anchor::Left => Pos::new(HPos::Left, VPos::Center),
            Anchor::Right => Pos::new(HPos::Right, VPos::Center),
            Anchor::Top => Pos::new(HPos::Center, VPos::Top),
        };
        let style = TextStyle::from(("sans-serif", size).into_font()).color(&colour).pos(pos);
        self.root.draw(&Text::new(text.to_owned(), at, style)).map_err(PictureError::new)
    }
}

fn stroke(colour: RGBAColor, width: i32) -> ShapeStyle {
    colour.stroke_width(width.unsigned_abs())
}

/// Approximate width of a text of this size: the font is the viewer's.
pub(super) fn text_width(text: &str, size: i32) -> i32 {
    let characters = i32::try_from(text.chars().count()).unwrap_or(i32::MAX / 64).min(1000);
    characters * size * 58 / 100
}

/// Reason why there is no picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the picture cannot be drawn: {reason}")]
pub struct PictureError {
    /// The message of the drawing library.
    pub reason: String,
}

impl PictureError {
    pub(super) fn new(error: impl Display) -> Self {
        Self { reason: error.to_string() }
    }
}
