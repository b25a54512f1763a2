use foxhunt_core::parameter::{ParameterError, positive};
use nalgebra::Vector2;

use super::{Shape, number};

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

#[cfg(test)]
mod tests {
    use super::*;

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
}
