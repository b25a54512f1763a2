use plotters::style::RGBColor;

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
pub(super) fn drone(index: usize) -> RGBColor {
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
