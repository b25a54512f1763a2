use foxhunt_core::parameter::{ParameterError, positive};
use nalgebra::Vector2;

use super::Shape;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::Polygon;

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
