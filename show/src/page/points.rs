//! Many points and cells in a few characters.

use foxhunt_wire::packed;
use nalgebra::Vector2;
use serde::Serialize;

use crate::raster::Raster;

/// Points within a box, each number in 4095 steps of its range.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Points {
    /// The least of both numbers.
    from: [f64; 2],
    /// Extent of both numbers beyond the least.
    size: [f64; 2],
    /// The points, four characters each, the more significant first.
    points: String,
}

impl Points {
    /// Packs points; points that are not finite are left out.
    pub(super) fn new(points: &[Vector2<f64>]) -> Self {
        let packed::PackedPoints { from, size, text } = packed::points(points);
        Self { from, size, points: text }
    }
}

/// Values of cells, each in 4095 steps of its range, two characters each.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Cells {
    /// The corner that is farthest south and west.
    corner: [f64; 2],
    /// Side of a cell in metres.
    cell: f64,
    columns: usize,
    low: f64,
    high: f64,
    /// From the South-West to the East, then row by row to the North.
    numbers: String,
}

impl Cells {
    /// Packs the values between two bounds.
    pub(super) fn new(raster: &Raster, [low, high]: [f64; 2]) -> Self {
        let numbers = packed::numbers(&raster.values, [low, high]);
        let corner = [raster.corner.x, raster.corner.y];
        Self { corner, cell: raster.cell_m, columns: raster.columns, low, high, numbers }
    }
}
