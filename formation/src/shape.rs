//! Shapes: how drones are arranged about the centre of their formation.

use core::f64::consts::TAU;

use foxhunt_core::{
    Station, Waypoint,
    parameter::{ParameterError, finite, positive, require},
};
use nalgebra::{Vector2, Vector3};

/// Distance from a single place to the next copy of it, in metres: the reference's circumradius
/// (Pritzl 2018, §5.2).
const ALONE_M: f64 = 6.0;

/// Arrangement of drones about the centre of their formation, for any number of them.
///
/// One method is required. A closure through [`shape_fn`] is a shape as well.
///
/// ```
/// use foxhunt_core::{FormationPlanner, Pose, Station};
/// use foxhunt_formation::{FollowConfig, FollowEstimate, Shape};
/// use nalgebra::Vector2;
///
/// /// A V, the first drone at its tip, as geese fly.
/// struct Wedge {
///     spacing_m: f64,
/// }
///
/// impl Shape for Wedge {
///     fn offset(&self, index: usize, _count: usize) -> Vector2<f64> {
///         let row = self.spacing_m * index.div_ceil(2) as f64;
///         let side = if index % 2 == 1 { 1.0 } else { -1.0 };
///         Vector2::new(-row, side * row)
///     }
/// }
///
/// let planner = FollowEstimate::new(FollowConfig::default())?;
/// let mut planner = planner.with_shape(Wedge { spacing_m: 5.0 });
/// let mut drones = [Station::holding(Pose::at(0.0, 0.0, 4.0)); 3];
/// planner.begin(&mut drones)?;
/// assert_eq!(drones[1].goal.position.xy(), Vector2::new(-5.0, 5.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Shape {
    /// The place of drone `index` of `count` relative to the centre while the formation is not
    /// turned, East and North in metres. No two drones have the same place.
    fn offset(&self, index: usize, count: usize) -> Vector2<f64>;

    /// The place of that drone in the world, East, North and Up in metres: turned by `rotation`
    /// radians counter-clockwise about `centre`, at `altitude`.
    fn vertex(
        &self,
        centre: &Vector2<f64>,
        rotation: f64,
        altitude: f64,
        index: usize,
        count: usize,
    ) -> Vector3<f64> {
        let offset = self.offset(index, count);
        let sin = libm::sin(rotation);
        let cos = libm::cos(rotation);
        Vector3::new(
            centre.x + cos * offset.x - sin * offset.y,
            centre.y + sin * offset.x + cos * offset.y,
            altitude,
        )
    }

    /// [`vertex`](Self::vertex) as a goal.
    fn goal(
        &self,
        centre: &Vector2<f64>,
        rotation: f64,
        altitude: f64,
        index: usize,
        count: usize,
    ) -> Waypoint {
        Waypoint { position: self.vertex(centre, rotation, altitude, index, count) }
    }
}

macro_rules! forward {
    ($($pointer:ty),+) => {$(
        impl<S: Shape + ?Sized> Shape for $pointer {
            fn offset(&self, index: usize, count: usize) -> Vector2<f64> {
                (**self).offset(index, count)
            }
            fn vertex(
                &self,
                centre: &Vector2<f64>,
                rotation: f64,
                altitude: f64,
                index: usize,
                count: usize,
            ) -> Vector3<f64> {
                (**self).vertex(centre, rotation, altitude, index, count)
            }
            fn goal(
                &self,
                centre: &Vector2<f64>,
                rotation: f64,
                altitude: f64,
                index: usize,
                count: usize,
            ) -> Waypoint {
                (**self).goal(centre, rotation, altitude, index, count)
            }
        }
    )+};
}

forward!(&S);

#[cfg(feature = "alloc")]
forward!(alloc::boxed::Box<S>);

/// The shape that [`shape_fn`] makes.
#[derive(Clone, Copy, Debug)]
pub struct ShapeFn<F>(F);

impl<F: Fn(usize, usize) -> Vector2<f64>> Shape for ShapeFn<F> {
    fn offset(&self, index: usize, count: usize) -> Vector2<f64> {
        (self.0)(index, count)
    }
}

/// A regular polygon of drones about a centre, all at one altitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polygon {
    /// From the centre to each drone, in metres.
    pub circumradius: f64,
}

impl Polygon {
    /// The place of drone `index` of `count`, East, North and Up in metres.
    ///
    /// `rotation` is the direction of the first drone from the centre, in radians
    /// counter-clockwise from East; the others follow counter-clockwise.
    #[must_use]
    pub fn vertex(
        &self,
        centre: &Vector2<f64>,
        rotation: f64,
        altitude: f64,
        index: usize,
        count: usize,
    ) -> Vector3<f64> {
        let angle = rotation + TAU * number(index) / number(count.max(1));
        Vector3::new(
            centre.x + self.circumradius * libm::cos(angle),
            centre.y + self.circumradius * libm::sin(angle),
            altitude,
        )
    }
}

impl Shape for Polygon {
    fn offset(&self, index: usize, count: usize) -> Vector2<f64> {
        self.vertex(&Vector2::zeros(), 0.0, 0.0, index, count).xy()
    }

    fn vertex(
        &self,
        centre: &Vector2<f64>,
        rotation: f64,
        altitude: f64,
        index: usize,
        count: usize,
    ) -> Vector3<f64> {
        // One sine of the sum of the angles is nearer the truth than a rotated offset.
        Self::vertex(self, centre, rotation, altitude, index, count)
    }
}

/// Drones side by side, as they sweep an area abreast; the centre is the middle of the line.
///
/// The first one is at the eastern end while the line is not turned, so the rotation is the
/// direction of the first drone from the centre, as with a polygon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    spacing: f64,
}

impl Line {
    /// A line with `spacing_m` metres from one drone to the next.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] when that is not finite and positive.
    pub fn new(spacing_m: f64) -> Result<Self, ParameterError> {
        positive("spacing_m", spacing_m)?;
        Ok(Self { spacing: spacing_m })
    }
}

impl Shape for Line {
    fn offset(&self, index: usize, count: usize) -> Vector2<f64> {
        let middle = 0.5 * (number(count.max(1)) - 1.0);
        Vector2::new(self.spacing * (middle - number(index)), 0.0)
    }
}

/// Given places about the centre, in the order of the drones.
///
/// With fewer drones than places, the last places stay empty. With more drones, the whole
/// pattern is laid out again beside itself, East, West, farther East and so on, by its width and
/// the least distance in it, so that no two drones come closer than two of the pattern are.
///
/// The places may be an array, a slice or a `Vec`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offsets<C> {
    places: C,
    stride: f64,
}

impl<C: AsRef<[Vector2<f64>]>> Offsets<C> {
    /// A shape of these places, East and North of the centre in metres.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names a coordinate that is not finite, or the list if it has no place or
    /// one place twice.
    pub fn new(places: C) -> Result<Self, ParameterError> {
        let given = places.as_ref();
        let count = number(given.len());
        require(!given.is_empty(), "offsets_m", count, "one place at least")?;
        let mut least = f64::INFINITY;
        let mut west = f64::INFINITY;
        let mut east = f64::NEG_INFINITY;
        for (i, place) in given.iter().enumerate() {
            finite("offsets_m", place.x)?;
            finite("offsets_m", place.y)?;
            (west, east) = (west.min(place.x), east.max(place.x));
            for other in &given[..i] {
                least = least.min((place - other).norm());
            }
        }
        require(least > 0.0, "offsets_m", least, "no place twice")?;
        let gap = if least.is_finite() { least } else { ALONE_M };
        let stride = east - west + gap;
        finite("offsets_m", stride)?;
        Ok(Self { places, stride })
    }
}

impl<C: AsRef<[Vector2<f64>]>> Shape for Offsets<C> {
    fn offset(&self, index: usize, _count: usize) -> Vector2<f64> {
        let places = self.places.as_ref();
        let copy = index / places.len();
        let place = index % places.len();
        // 0, 1 East, 1 West, 2 East, …
        let away = self.stride * number(copy.div_ceil(2));
        let east = if copy % 2 == 1 { away } else { -away };
        places[place] + Vector2::new(east, 0.0)
    }
}

/// A shape made larger or smaller about its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaled<S> {
    shape: S,
    scale: f64,
}

impl<S: Shape> Scaled<S> {
    /// `scale` times the size of `shape`.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] when the scale is not finite and positive.
    pub fn new(shape: S, scale: f64) -> Result<Self, ParameterError> {
        positive("scale", scale)?;
        Ok(Self { shape, scale })
    }
}

impl<S: Shape> Shape for Scaled<S> {
    fn offset(&self, index: usize, count: usize) -> Vector2<f64> {
        self.shape.offset(index, count) * self.scale
    }
}

/// Sets the goal of every drone to its place in a shape.
pub(super) fn arrange<S: Shape>(
    shape: &S,
    centre: &Vector2<f64>,
    rotation: f64,
    altitude: f64,
    stations: &mut [Station],
) {
    let count = stations.len();
    for (index, station) in stations.iter_mut().enumerate() {
        station.goal = shape.goal(centre, rotation, altitude, index, count);
    }
}

/// Sets the goal of every drone to its place in a shape; a drone alone goes to the centre.
pub(super) fn arrange_or_centre<S: Shape>(
    shape: &S,
    centre: &Vector2<f64>,
    rotation: f64,
    altitude: f64,
    stations: &mut [Station],
) {
    if let [alone] = stations {
        alone.goal.position = centre.push(altitude);
    } else {
        arrange(shape, centre, rotation, altitude, stations);
    }
}

/// A shape made of a closure from index and count to East and North of the centre.
///
/// ```
/// use foxhunt_formation::{Shape, shape_fn};
/// use nalgebra::Vector2;
/// // A column, 5 m from one to the next.
/// let column = shape_fn(|index, _count| Vector2::new(-5.0 * index as f64, 0.0));
/// assert_eq!(column.offset(2, 3), Vector2::new(-10.0, 0.0));
/// ```
pub fn shape_fn<F: Fn(usize, usize) -> Vector2<f64>>(offset: F) -> ShapeFn<F> {
    ShapeFn(offset)
}

/// A count as a number.
pub(super) fn number(count: usize) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use core::f64::consts::FRAC_PI_2;

    use super::*;
    use crate::shape::Polygon;

    #[test]
    fn a_shape_is_turned_counter_clockwise_about_its_centre() {
        let column = shape_fn(|index, _| Vector2::new(2.0 * number(index), 1.0));
        let centre = Vector2::new(10.0, -5.0);
        let vertex = column.vertex(&centre, FRAC_PI_2, 3.0, 2, 3);
        assert!((vertex - Vector3::new(9.0, -1.0, 3.0)).norm() < 1e-12, "{vertex}");
        assert_eq!(column.goal(&centre, FRAC_PI_2, 3.0, 2, 3).position, vertex);
    }

    #[test]
    fn a_square_has_equal_sides() {
        let square = Polygon { circumradius: 2.0 };
        let centre = Vector2::new(10.0, -5.0);
        for i in 0..4 {
            let a = square.vertex(&centre, 0.4, 3.0, i, 4);
            let b = square.vertex(&centre, 0.4, 3.0, (i + 1) % 4, 4);
            assert_abs_diff_eq!((a - b).norm(), libm::sqrt(8.0), epsilon = 1e-12);
            assert_abs_diff_eq!((a.xy() - centre).norm(), 2.0, epsilon = 1e-12);
            assert_eq!(Shape::vertex(&square, &centre, 0.4, 3.0, i, 4), a);
        }
    }

    #[test]
    fn a_line_is_even_and_about_its_centre() {
        let line = Line::new(8.0).expect("a spacing");
        for count in 1..=8 {
            let sum: Vector2<f64> = (0..count).map(|i| line.offset(i, count)).sum();
            assert!(sum.norm() < 1e-12, "{count} drones are not about their centre");
            for i in 1..count {
                let step = line.offset(i - 1, count) - line.offset(i, count);
                assert!((step - Vector2::new(8.0, 0.0)).norm() < 1e-12);
            }
        }
        assert_eq!(Line::new(0.0).expect_err("no spacing").name, "spacing_m");
    }

    #[test]
    fn more_drones_than_places_keep_their_distance() {
        let given = [Vector2::zeros(), Vector2::new(4.0, 0.0), Vector2::new(0.0, 3.0)];
        let shape = Offsets::new(given).expect("three places");
        for (index, place) in given.iter().enumerate() {
            assert_eq!(shape.offset(index, 12), *place);
        }
        for (index, east) in [(3, 7.0), (6, -7.0), (9, 14.0)] {
            assert!((shape.offset(index, 12) - Vector2::new(east, 0.0)).norm() < 1e-12);
        }
        for a in 0..12 {
            for b in 0..a {
                let apart = (shape.offset(a, 12) - shape.offset(b, 12)).norm();
                assert!(apart >= 3.0 - 1e-12, "{a} and {b} are {apart} m apart");
            }
        }
        let alone = Offsets::new([Vector2::new(1.0, 1.0)]).expect("one place");
        assert!((alone.offset(0, 2) - alone.offset(1, 2)).norm() > 5.9);
    }

    #[test]
    fn places_that_make_no_shape_are_refused() {
        let none: [Vector2<f64>; 0] = [];
        assert!(Offsets::new(none).is_err());
        assert!(Offsets::new([Vector2::zeros(), Vector2::zeros()]).is_err());
        let error = Offsets::new([Vector2::new(0.0, f64::NAN)]).expect_err("no place");
        assert_eq!(error.name, "offsets_m");
    }

    #[test]
    fn a_scaled_triangle_is_a_larger_triangle() {
        let triangle = Polygon { circumradius: 2.0 };
        let larger = Scaled::new(triangle, 3.0).expect("a scale");
        for index in 0..3 {
            let expected = Polygon { circumradius: 6.0 }.offset(index, 3);
            assert!((larger.offset(index, 3) - expected).norm() < 1e-12);
        }
        assert!(Scaled::new(triangle, -1.0).is_err());
    }
}
