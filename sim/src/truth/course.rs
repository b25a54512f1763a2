use std::f64::consts::TAU;

/// The way that an antenna was ordered within one pattern.
#[derive(Clone, Copy, Debug)]
pub(super) struct Course {
    start: f64,
    last: f64,
    /// Towards larger angles; not known before the second order.
    forwards: Option<bool>,
}

impl Course {
    /// An antenna that stands at `angle` radians.
    pub(super) fn at(angle: f64) -> Self {
        Self { start: angle, last: angle, forwards: None }
    }

    /// Returns true if an order to `angle` leads nowhere.
    pub(super) fn stays(&self, angle: f64) -> bool {
        angle.to_bits() == self.last.to_bits()
    }

    /// Takes an order; false when a new pattern begins with it: the antenna stays, goes back, or
    /// has been all the way round.
    ///
    /// The first order of a pattern does not show its direction, which may be the approach to
    /// the end that a turn starts from.
    pub(super) fn follow(&mut self, angle: f64) -> bool {
        let stays = self.stays(angle);
        let forwards = angle > self.last;
        let turns_back = self.forwards.is_some_and(|before| before != forwards);
        // The last of many equal steps may fall short of a turn by rounding.
        let round = (angle - self.start).abs() > TAU - 1e-9;
        if stays || turns_back || round {
            *self = Self::at(angle);
            return false;
        }
        self.last = angle;
        self.forwards = Some(forwards);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The orders, by their number, with which a new pattern begins.
    fn breaks(orders: &[f64]) -> Vec<usize> {
        let mut course = Course::at(0.0);
        (0..orders.len()).filter(|&i| !course.follow(orders[i])).collect()
    }

    #[test]
    fn turns_to_and_fro_are_a_pattern_each() {
        assert_eq!(breaks(&[0.0, 1.0, 2.0, 2.0, 1.0, 0.0, 0.0, 1.0, 2.0]), [0, 3, 6]);
    }

    #[test]
    fn a_turn_that_was_given_up_ends_where_the_next_begins() {
        assert_eq!(breaks(&[0.0, 1.0, 2.0, 0.0, 1.0, 2.0, 3.0]), [0, 3]);
    }

    #[test]
    fn a_turn_without_a_cable_ends_after_all_its_positions() {
        let orders: Vec<f64> = (1..=20).map(|i| f64::from(i) * TAU / 10.0).collect();
        assert_eq!(breaks(&orders), [9, 19]);
    }
}
