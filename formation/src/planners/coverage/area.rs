use alloc::vec::Vec;

use nalgebra::Vector2;

use super::CoverageError;

/// A simple polygon, turned so that rows run along East.
pub(super) struct Area {
    corners: Vec<Vector2<f64>>,
}

/// A part of a row, from West to East.
pub(super) type Interval = (f64, f64);

impl Area {
    /// Takes a polygon that has three corners at least and does not meet itself. The first corner
    /// may come again at the end.
    pub(super) fn new(corners: &[Vector2<f64>]) -> Result<Self, CoverageError> {
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
    pub(super) fn longest_side(&self) -> f64 {
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
    pub(super) fn turned(&self, angle: f64) -> Self {
        Self { corners: self.corners.iter().map(|corner| turn(corner, angle)).collect() }
    }

    /// Its southern and northern end.
    pub(super) fn rows(&self) -> (f64, f64) {
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        self.corners.iter().fold(ends, |(low, high), c| (low.min(c.y), high.max(c.y)))
    }

    /// Returns the parts of the row at `north` that are inside and at least `margin` from every
    /// side, from West to East.
    pub(super) fn row(&self, north: f64, margin: f64) -> Vec<Interval> {
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

/// Turns a place counter-clockwise about the origin.
pub(super) fn turn(place: &Vector2<f64>, angle: f64) -> Vector2<f64> {
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
