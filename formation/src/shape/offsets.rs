use foxhunt_core::parameter::{ParameterError, finite, require};
use nalgebra::Vector2;

use super::{Shape, number};

/// Distance from a single place to the next copy of it, in metres: the reference's circumradius
/// (Pritzl 2018, §5.2).
const ALONE_M: f64 = 6.0;

/// Given places about the centre, in the order of the drones.
///
/// Where there are fewer drones, the last places stay empty. Where there are more, the whole
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
