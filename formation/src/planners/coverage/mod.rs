//! Sweeps over a polygon.

#[cfg(test)]
mod tests;

use alloc::{vec, vec::Vec};

use foxhunt_core::parameter::{ParameterError, finite, not_negative, positive, require};
use nalgebra::Vector2;

/// The most places of a sweep.
const MOST: f64 = 10_000.0;

/// Requirement on a spacing that is too small.
const TOO_MANY: &str = "so large that 10 000 places are enough";

/// A part of a row, from West to East.
type Interval = (f64, f64);

/// Reason that there is no sweep.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CoverageError {
    /// A spacing, the margin or the direction is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Fewer corners than an area has.
    #[error("{corners} corners make no area; it takes 3")]
    Corners {
        /// Number of corners.
        corners: usize,
    },
    /// A corner holds NaN or infinity.
    #[error("the corner ({east}, {north}) m is not finite")]
    NotFinite {
        /// East of the corner, in metres.
        east: f64,
        /// North of the corner, in metres.
        north: f64,
    },
    /// Two sides meet elsewhere than in a corner.
    #[error("side {first} of the area meets side {second}; sides are counted from 0")]
    Crossing {
        /// One side, from the corner of this number to the next.
        first: usize,
        /// The other one.
        second: usize,
    },
    /// The area is too small for the margin.
    #[error("no place in the area is {margin_m} m from its sides")]
    NoRoom {
        /// The margin.
        margin_m: f64,
    },
}

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
    /// The reference's sweep (Pritzl 2018, §7.4): rows 38 / 3 m apart, places on them 53 / 3 m, 6
    /// m from the sides.
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

/// A simple polygon, turned so that rows run along East.
struct Area {
    corners: Vec<Vector2<f64>>,
}

impl Area {
    /// Takes a polygon that has three corners at least and does not meet itself. The first corner
    /// may come again at the end.
    fn new(corners: &[Vector2<f64>]) -> Result<Self, CoverageError> {
        let corners = match corners {
            [first, open @ .., last] if first == last => &corners[..=open.len()],
            _ => corners,
        };
        if corners.len() < 3 {
            return Err(CoverageError::Corners { corners: corners.len() });
        }
        if let Some(bad) = corners.iter().find(|c| !(c.x.is_finite() && c.y.is_finite())) {
            return Err(CoverageError::NotFinite { east: bad.x, north: bad.y });
        }
        let area = Self { corners: corners.to_vec() };
        let count = corners.len();
        for (first, (a, b)) in area.edges().enumerate() {
            for (second, (c, d)) in area.edges().enumerate().skip(first + 1) {
                let next = second == first + 1 || (first == 0 && second + 1 == count);
                let meet = if next { folds(a, b, c, d) } else { cross(a, b, c, d) };
                if meet {
                    return Err(CoverageError::Crossing { first, second });
                }
            }
        }
        Ok(area)
    }

    fn edges(&self) -> impl Iterator<Item = (&Vector2<f64>, &Vector2<f64>)> {
        self.corners.iter().zip(self.corners.iter().cycle().skip(1))
    }

    /// The direction of its longest side in radians counter-clockwise from East: of its two senses
    /// the eastward one.
    fn longest_side(&self) -> f64 {
        let length = |(a, b): &(&Vector2<f64>, &Vector2<f64>)| (*b - *a).norm();
        // The first of several that are equally long.
        let longest = self.edges().reduce(
            |best, edge| {
                if length(&edge) > length(&best) { edge } else { best }
            },
        );
        longest.map_or(0.0, |(a, b)| {
            let side = b - a;
            let east = side.x > 0.0 || (side.x >= 0.0 && side.y > 0.0);
            let side = if east { side } else { -side };
            libm::atan2(side.y, side.x)
        })
    }

    /// Returns the area turned by an angle about the origin.
    fn turned(&self, angle: f64) -> Self {
        Self { corners: self.corners.iter().map(|corner| turn(corner, angle)).collect() }
    }

    /// Returns the southern and the northern end of the area.
    fn rows(&self) -> (f64, f64) {
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        self.corners.iter().fold(ends, |(low, high), c| (low.min(c.y), high.max(c.y)))
    }

    /// Returns the parts of the row at `north` that are inside and at least `margin` from every
    /// side, from West to East.
    fn row(&self, north: f64, margin: f64) -> Vec<Interval> {
        // A row along a side counts as inside.
        let (low, high) = self.rows();
        let nudge = 1e-9 * (high - low);
        let inside_at = north.max(low + nudge).min(high - nudge);
        let mut crossings: Vec<f64> = self
            .edges()
            .filter(|(a, b)| (a.y <= inside_at) != (b.y <= inside_at))
            .map(|(a, b)| a.x + (inside_at - a.y) / (b.y - a.y) * (b.x - a.x))
            .collect();
        crossings.sort_by(f64::total_cmp);
        let mut inside: Vec<Interval> =
            crossings.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
        // At exactly the margin is far enough.
        let reach = margin * (1.0 - 1e-9);
        for (a, b) in self.edges() {
            if let Some(near) = near(a, b, north, reach) {
                inside = inside.into_iter().flat_map(|i| without(i, near)).flatten().collect();
            }
        }
        inside
    }
}

/// A part of a row, and where that is.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Strip {
    north: f64,
    ends: Interval,
}

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

/// Returns the strips of all cells in the order in which they are swept, each from its first end to
/// its second: back and forth in a cell, then on to the nearest corner of the cells that remain.
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

/// Turns a place counter-clockwise about the origin.
fn turn(place: &Vector2<f64>, angle: f64) -> Vector2<f64> {
    let sin = libm::sin(angle);
    let cos = libm::cos(angle);
    Vector2::new(cos * place.x - sin * place.y, sin * place.x + cos * place.y)
}

/// An interval without the inside of another one: the parts West and East of it.
fn without((west, east): Interval, (from, to): Interval) -> [Option<Interval>; 2] {
    if to <= west || east <= from {
        return [Some((west, east)), None];
    }
    [(west <= from).then_some((west, from)), (to <= east).then_some((to, east))]
}

/// Returns the part of the row at `north` that is nearer than `reach` to a side: the row's cut
/// through two discs and the strip between them, which together are convex.
fn near(a: &Vector2<f64>, b: &Vector2<f64>, north: f64, reach: f64) -> Option<Interval> {
    let mut west = f64::INFINITY;
    let mut east = f64::NEG_INFINITY;
    let mut take = |x: f64| (west, east) = (west.min(x), east.max(x));
    for end in [a, b] {
        let half = reach * reach - (north - end.y) * (north - end.y);
        if half > 0.0 {
            take(end.x - libm::sqrt(half));
            take(end.x + libm::sqrt(half));
        }
    }
    let side = b - a;
    let across = Vector2::new(-side.y, side.x) * (reach / side.norm());
    let strip = [a + across, b + across, b - across, a - across];
    for (p, q) in strip.iter().zip(strip.iter().cycle().skip(1)) {
        if (p.y < north) != (q.y < north) {
            take(p.x + (north - p.y) / (q.y - p.y) * (q.x - p.x));
        }
    }
    (west < east).then_some((west, east))
}

/// Twice the area of a triangle, positive where it runs counter-clockwise.
fn orientation(a: &Vector2<f64>, b: &Vector2<f64>, c: &Vector2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

/// Returns true if a place on the line of a side lies on the side itself.
fn between(a: &Vector2<f64>, b: &Vector2<f64>, place: &Vector2<f64>) -> bool {
    (place - a).dot(&(place - b)) <= 0.0
}

/// Returns true if two sides meet (Cormen et al. 2009, §33.1).
fn cross(a: &Vector2<f64>, b: &Vector2<f64>, c: &Vector2<f64>, d: &Vector2<f64>) -> bool {
    let c_side = orientation(a, b, c);
    let d_side = orientation(a, b, d);
    let a_side = orientation(c, d, a);
    let b_side = orientation(c, d, b);
    let on = |side: f64, p, q, place| side.abs() <= 0.0 && between(p, q, place);
    (c_side * d_side < 0.0 && a_side * b_side < 0.0)
        || on(c_side, a, b, c)
        || on(d_side, a, b, d)
        || on(a_side, c, d, a)
        || on(b_side, c, d, b)
}

/// Returns true if two neighbouring sides lie on one another, or one of them has no length.
fn folds(a: &Vector2<f64>, b: &Vector2<f64>, c: &Vector2<f64>, d: &Vector2<f64>) -> bool {
    // The corner that they share comes last of one and first of the other.
    let (before, corner, after) = if b == c { (a, b, d) } else { (c, a, b) };
    let straight = orientation(before, corner, after).abs() <= 0.0;
    straight && (before - corner).dot(&(after - corner)) >= 0.0
}

/// The cells of rows, from the South: within one of them each row is in one piece, so that it can
/// be swept back and forth (boustrophedon decomposition, Choset & Pignon 1998). A cell ends where a
/// row falls apart, or several become one.
fn cells(rows: &[(f64, Vec<Interval>)]) -> Vec<Vec<Strip>> {
    let mut cells: Vec<Vec<Strip>> = Vec::new();
    // The intervals of the row before, and the cell that each is in.
    let mut before: Vec<(Interval, usize)> = Vec::new();
    for (north, intervals) in rows {
        let mut now = Vec::new();
        for &ends in intervals {
            let meets = |other: &Interval| other.0 <= ends.1 && ends.0 <= other.1;
            let mut below = before.iter().filter(|(other, _)| meets(other));
            let strip = Strip { north: *north, ends };
            let cell = match (below.next(), below.next()) {
                (Some(&(other, cell)), None) if one_above(&other, intervals) => {
                    cells[cell].push(strip);
                    cell
                }
                _ => {
                    cells.push(vec![strip]);
                    cells.len() - 1
                }
            };
            now.push((ends, cell));
        }
        before = now;
    }
    cells
}

/// Returns true if exactly one interval of a row meets one of the row before.
fn one_above(below: &Interval, row: &[Interval]) -> bool {
    row.iter().filter(|i| i.0 <= below.1 && below.0 <= i.1).count() == 1
}
