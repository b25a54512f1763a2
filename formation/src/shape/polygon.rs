use core::f64::consts::TAU;

use nalgebra::{Vector2, Vector3};

use super::{Shape, number};

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_has_equal_sides() {
        let square = Polygon { circumradius: 2.0 };
        let centre = Vector2::new(10.0, -5.0);
        for i in 0..4 {
            let (a, b) = (
                square.vertex(&centre, 0.4, 3.0, i, 4),
                square.vertex(&centre, 0.4, 3.0, (i + 1) % 4, 4),
            );
            assert!(((a - b).norm() - libm::sqrt(8.0)).abs() < 1e-12);
            assert!(((a.xy() - centre).norm() - 2.0).abs() < 1e-12);
            assert_eq!(Shape::vertex(&square, &centre, 0.4, 3.0, i, 4), a);
        }
    }
}
