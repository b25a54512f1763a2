use alloc::vec::Vec;

use foxhunt_core::parameter::{ParameterError, finite, not_negative, positive, require};
use nalgebra::Vector2;

use super::{
    Area, CoverageError,
    area::{Interval, turn},
    cells::{Strip, cells},
};

/// The most places of a sweep.
const MOST: f64 = 10_000.0;

/// Configuration of a sweep over an area.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct CoverageConfig {
    /// The most from one row to the next, in metres.
    pub row_spacing_m: f64,
    /// The most from one place to the next along a row, in metres.
    pub along_spacing_m: f64,
    /// Least distance of every place from the sides of the area, in metres.
    pub margin_m: f64,
    /// The direction of the rows, in radians counter-clockwise from East; along the area's longest
    /// side unless given.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub direction_rad: Option<f64>,
}

impl Default for CoverageConfig {
    /// The reference's sweep (Pritzl 2018, §7.4): rows 38 / 3 m apart, places on them 53 / 3 m, 6 m
    /// from the sides.
    fn default() -> Self {
        Self {
            row_spacing_m: 38.0 / 3.0,
            along_spacing_m: 53.0 / 3.0,
            margin_m: 6.0,
            direction_rad: None,
        }
    }
}

impl CoverageConfig {
    fn check(&self) -> Result<(), ParameterError> {
        positive("row_spacing_m", self.row_spacing_m)?;
        positive("along_spacing_m", self.along_spacing_m)?;
        not_negative("margin_m", self.margin_m)?;
        finite("direction_rad", self.direction_rad.unwrap_or(0.0))?;
        Ok(())
    }
}

/// The places of a sweep over an area, back and forth in rows (boustrophedon; Choset & Pignon
/// 1998): what [`Waypoints`](crate::Waypoints) visits one after the other.
///
/// The area is any simple polygon. Where a row falls apart, as it does in one that is not convex,
/// the area is cut into cells that are swept one after the other, the nearest next. The way from
/// cell to cell is straight, and may leave the area.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    places: Vec<Vector2<f64>>,
}

impl Coverage {
    /// A sweep over the polygon with these corners, East and North in metres, in either sense;
    /// the first one may come again at the end, as in GeoJSON.
    ///
    /// # Errors
    ///
    /// [`CoverageError`] when that is no simple polygon, a parameter is out of its range, no
    /// place keeps the margin, or there were more than 10 000.
    pub fn new(corners: &[Vector2<f64>], config: &CoverageConfig) -> Result<Self, CoverageError> {
        config.check()?;
        let area = Area::new(corners)?;
        let direction = config.direction_rad.unwrap_or_else(|| area.longest_side());
        let area = area.turned(-direction);
        let (low, high) = area.rows();
        let low = low + config.margin_m;
        let high = high - config.margin_m;
        let norths = spread((low, high), config.row_spacing_m)?;
        let rows: Vec<(f64, Vec<Interval>)> =
            norths.into_iter().map(|north| (north, area.row(north, config.margin_m))).collect();
        let mut places = Vec::new();
        for strip in in_order(cells(&rows)) {
            let (from, to) = strip.ends;
            let ordered = if from <= to { (from, to) } else { (to, from) };
            let mut easts = spread(ordered, config.along_spacing_m)?;
            if from > to {
                easts.reverse();
            }
            let place = |east| turn(&Vector2::new(east, strip.north), direction);
            places.extend(easts.into_iter().map(place));
            let so_far = crate::shape::number(places.len());
            require(so_far <= MOST, "along_spacing_m", config.along_spacing_m, TOO_MANY)?;
        }
        if places.is_empty() {
            return Err(CoverageError::NoRoom { margin_m: config.margin_m });
        }
        Ok(Self { places })
    }

    /// The places, East and North in metres, in the order of the sweep.
    #[must_use]
    pub fn places(&self) -> &[Vector2<f64>] {
        &self.places
    }
}

impl AsRef<[Vector2<f64>]> for Coverage {
    fn as_ref(&self) -> &[Vector2<f64>] {
        &self.places
    }
}

/// Requirement on a spacing that is too small.
const TOO_MANY: &str = "so large that 10 000 places are enough";

/// Evenly spread values from one end to the other, both included, at most `spacing` apart; none
/// where the ends are the wrong way round.
fn spread((low, high): Interval, spacing: f64) -> Result<Vec<f64>, ParameterError> {
    let gaps = libm::ceil((high - low) / spacing - 1e-6).max(0.0);
    require(gaps < MOST, "row_spacing_m", spacing, TOO_MANY)?;
    if high < low {
        return Ok(Vec::new());
    }
    if gaps < 1.0 {
        return Ok(Vec::from([0.5 * (low + high)]));
    }
    let mut values = Vec::new();
    let mut gap = 0.0;
    while gap <= gaps {
        values.push(low + (high - low) * gap / gaps);
        gap += 1.0;
    }
    Ok(values)
}

/// The strips of all cells in the order in which they are swept, each from its first end to its
/// second: back and forth in a cell, then on to the corner that is nearest of those that are left.
fn in_order(mut left: Vec<Vec<Strip>>) -> Vec<Strip> {
    let mut ordered: Vec<Strip> = Vec::new();
    while !left.is_empty() {
        let here = ordered.last().map(|strip| Vector2::new(strip.ends.1, strip.north));
        let mut best = (f64::INFINITY, 0, false, false);
        for (index, cell) in left.iter().enumerate() {
            for (downward, westward) in [(false, false), (false, true), (true, false), (true, true)]
            {
                let entry = if downward { cell.last() } else { cell.first() };
                let Some(strip) = entry else { continue };
                let east = if westward { strip.ends.1 } else { strip.ends.0 };
                let corner = Vector2::new(east, strip.north);
                let way = here.map_or(0.0, |here| (corner - here).norm());
                if way < best.0 {
                    best = (way, index, downward, westward);
                }
            }
        }
        let (_, index, downward, mut westward) = best;
        let mut cell = left.remove(index);
        if downward {
            cell.reverse();
        }
        for Strip { north, ends: (west, east) } in cell {
            let ends = if westward { (east, west) } else { (west, east) };
            ordered.push(Strip { north, ends });
            westward = !westward;
        }
    }
    ordered
}
