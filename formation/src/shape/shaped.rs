use foxhunt_core::{Station, Waypoint};
use nalgebra::{Vector2, Vector3};

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

/// Sets the goal of every drone to its place in a shape.
pub(crate) fn arrange<S: Shape>(
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
pub(crate) fn arrange_or_centre<S: Shape>(
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

/// The shape that [`shape_fn`] makes.
#[derive(Clone, Copy, Debug)]
pub struct ShapeFn<F>(F);

impl<F: Fn(usize, usize) -> Vector2<f64>> Shape for ShapeFn<F> {
    fn offset(&self, index: usize, count: usize) -> Vector2<f64> {
        (self.0)(index, count)
    }
}

/// A count as a number.
pub(crate) fn number(count: usize) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use core::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn a_shape_is_turned_counter_clockwise_about_its_centre() {
        let column = shape_fn(|index, _| Vector2::new(2.0 * number(index), 1.0));
        let centre = Vector2::new(10.0, -5.0);
        let vertex = column.vertex(&centre, FRAC_PI_2, 3.0, 2, 3);
        assert!((vertex - Vector3::new(9.0, -1.0, 3.0)).norm() < 1e-12, "{vertex}");
        assert_eq!(column.goal(&centre, FRAC_PI_2, 3.0, 2, 3).position, vertex);
    }
}
