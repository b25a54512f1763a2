use core::fmt::Debug;

use nalgebra::Vector2;

/// The height of the ground: an elevation model, or a formula.
///
/// ```
/// use foxhunt_core::{Terrain, nalgebra::Vector2};
///
/// /// A slope that rises by a metre in ten towards the East.
/// #[derive(Debug)]
/// struct Slope;
///
/// impl Terrain for Slope {
///     fn height(&self, place: &Vector2<f64>) -> Option<f64> {
///         Some(0.1 * place.x)
///     }
///
///     fn step_m(&self) -> f64 {
///         50.0
///     }
/// }
///
/// assert!(Slope.height(&Vector2::new(20.0, 5.0)).is_some_and(|m| (m - 2.0).abs() < 1e-12));
/// ```
///
/// # Laws
///
/// A height is finite, and always the same at the same place; the step is a positive number.
pub trait Terrain: Debug {
    /// The height of the ground at a place, East and North in metres, in metres above whatever the
    /// terrain counts from, which is the same everywhere; `None` where it is not known.
    fn height(&self, place: &Vector2<f64>) -> Option<f64>;

    /// Distance along a line between the places whose heights are looked at, in metres, so that
    /// nothing that matters lies between two of them.
    fn step_m(&self) -> f64;
}
