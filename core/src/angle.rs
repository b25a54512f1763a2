//! Angles and circular statistics: the one place where an angle wraps.

use core::{
    f64::consts::{PI, TAU},
    ops::AddAssign,
};

/// Wraps `angle` onto [−π, π).
///
/// ```
/// use foxhunt_core::angle::wrap;
/// assert!((wrap(3.5 * core::f64::consts::PI) + 0.5 * core::f64::consts::PI).abs() < 1e-12);
/// ```
#[must_use]
#[inline]
pub fn wrap(angle: f64) -> f64 {
    if (-PI..PI).contains(&angle) {
        return angle;
    }
    // One turn, as most often: exact, as the remainder is.
    if angle.abs() < 3.0 + TAU {
        return angle - TAU.copysign(angle);
    }
    let wrapped = libm::remainder(angle, TAU);
    if wrapped >= PI { wrapped - TAU } else { wrapped }
}

/// The unsigned angle between two directions, in [0, π].
#[must_use]
pub fn distance(a: f64, b: f64) -> f64 {
    libm::fabs(wrap(a - b))
}

/// The position, of `positions` at equal angles in a turn, that is nearest to an angle in radians;
/// the first is at 0.
///
/// ```
/// use foxhunt_core::angle::nearest_position;
/// assert_eq!(nearest_position(-0.3, 4), 0);
/// assert_eq!(nearest_position(-1.4, 4), 3);
/// ```
#[must_use]
pub fn nearest_position(angle: f64, positions: u16) -> u16 {
    let steps = libm::round(wrap(angle) / TAU * f64::from(positions));
    #[expect(clippy::cast_possible_truncation, reason = "half a turn of at most u16::MAX steps")]
    let steps = (steps as i32).rem_euclid(i32::from(positions.max(1)));
    u16::try_from(steps).unwrap_or(0)
}

/// The weighted resultant of directions: where they point, and how well they agree
/// (Mardia & Jupp 2000, §2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Resultant {
    cos: f64,
    sin: f64,
    weight: f64,
}

impl Resultant {
    /// Adds one direction, in radians, with a weight.
    pub fn add(&mut self, angle: f64, weight: f64) {
        let (sin, cos) = libm::sincos(angle);
        self.cos += weight * cos;
        self.sin += weight * sin;
        self.weight += weight;
    }

    /// The mean direction as a resultant of this weight; [`None`] where the directions cancel, as
    /// in [`direction`](Self::direction).
    #[must_use]
    pub fn with_weight(&self, weight: f64, least_length: f64) -> Option<Self> {
        let length = self.length();
        (length > least_length).then(|| {
            let scale = weight / (length * self.weight);
            Self { cos: self.cos * scale, sin: self.sin * scale, weight }
        })
    }

    /// The resultant with all weights multiplied by a factor.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self { cos: self.cos * factor, sin: self.sin * factor, weight: self.weight * factor }
    }

    /// The mean direction, or `None` where the directions cancel: a resultant length below
    /// `least_length` is rounding, not a direction.
    #[must_use]
    pub fn direction(&self, least_length: f64) -> Option<f64> {
        (self.length() > least_length).then(|| libm::atan2(self.sin, self.cos))
    }

    /// The mean resultant length R̄ in [0, 1]; the circular variance is 1 − R̄.
    #[must_use]
    pub fn length(&self) -> f64 {
        if self.weight > 0.0 { libm::hypot(self.sin, self.cos) / self.weight } else { 0.0 }
    }
}

impl AddAssign for Resultant {
    /// Adds all directions of another resultant.
    fn add_assign(&mut self, other: Self) {
        self.cos += other.cos;
        self.sin += other.sin;
        self.weight += other.weight;
    }
}

impl FromIterator<f64> for Resultant {
    /// The resultant of directions of equal weight.
    fn from_iter<I: IntoIterator<Item = f64>>(angles: I) -> Self {
        let mut resultant = Self::default();
        for angle in angles {
            resultant.add(angle, 1.0);
        }
        resultant
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn wrap_is_half_open() {
        assert_abs_diff_eq!(wrap(PI), -PI, epsilon = 1e-15);
        assert_abs_diff_eq!(wrap(-PI), -PI, epsilon = 1e-15);
        assert_abs_diff_eq!(wrap(PI - 1e-9), PI - 1e-9, epsilon = 1e-15);
        assert_abs_diff_eq!(wrap(100.0), -0.530_964_914_873_376, epsilon = 1e-12);
    }

    #[test]
    fn the_nearest_position_goes_round() {
        for (degrees, expected) in
            [(0.0, 0), (44.9, 0), (45.1, 1), (-44.9, 0), (-45.1, 3), (180.0, 2), (359.0, 0)]
        {
            let position = nearest_position(f64::to_radians(degrees), 4);
            assert_eq!(position, expected, "{degrees}°");
        }
        assert_eq!(nearest_position(-0.01, 65_535), 65_431);
        assert_eq!(nearest_position(3.0, 1), 0);
        assert_eq!(nearest_position(3.0, 0), 0, "a turn without positions");
    }

    #[test]
    fn opposite_directions_have_no_mean() {
        let across: Resultant = [3.0, -3.0].into_iter().collect();
        assert!(distance(across.direction(1e-9).expect("they agree"), PI) < 1e-12);
        let opposed: Resultant = [1.0, 1.0 + PI].into_iter().collect();
        assert_eq!(opposed.direction(1e-9), None);
    }
}
