use nalgebra::Vector3;

/// A drone's place and attitude in the local East-North-Up frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Pose {
    /// East, North and Up in metres.
    pub position: Vector3<f64>,
    /// The nose, in radians counter-clockwise from East.
    pub heading: f64,
    /// Angle of the nose above the horizon, in radians; 0 where a file has no value.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_zero"))]
    pub pitch: f64,
    /// Angle of the right side below the left, in radians; 0 where a file has no value.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_zero"))]
    pub roll: f64,
    /// Velocity to East, North and Up, in metres per second, where that is known.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub velocity: Option<Vector3<f64>>,
}

#[cfg(feature = "serde")]
fn is_zero(angle: &f64) -> bool {
    angle.to_bits() == 0
}

impl Pose {
    /// A level pose with the nose to the East.
    #[must_use]
    pub fn at(east: f64, north: f64, up: f64) -> Self {
        Self { position: Vector3::new(east, north, up), ..Self::default() }
    }

    /// A level pose.
    #[must_use]
    pub fn level(position: Vector3<f64>, heading: f64) -> Self {
        Self { position, heading, ..Self::default() }
    }

    /// A direction of the world frame in the body's own: forward, left and up along its axes.
    ///
    /// The body is turned by heading about Up, then by pitch about its left axis, then by roll
    /// about its nose.
    #[must_use]
    pub fn to_body(&self, world: &Vector3<f64>) -> Vector3<f64> {
        let turned = |a: f64, b: f64, angle: f64| {
            let sin = libm::sin(angle);
            let cos = libm::cos(angle);
            (cos * a + sin * b, cos * b - sin * a)
        };
        let (forward, left) = turned(world.x, world.y, self.heading);
        let (forward, up) = turned(forward, world.z, self.pitch);
        let (left, up) = turned(left, up, self.roll);
        Vector3::new(forward, left, up)
    }

    /// Returns true if every number in it is finite.
    #[must_use]
    #[inline]
    pub fn is_finite(&self) -> bool {
        let Self { position, heading, pitch, roll, velocity } = self;
        // Zero times a number that is not finite is NaN.
        let zero = |v: &Vector3<f64>| 0.0 * v.x + 0.0 * v.y + 0.0 * v.z;
        let angles = 0.0 * heading + 0.0 * pitch + 0.0 * roll;
        (zero(position) + angles + velocity.as_ref().map_or(0.0, zero)).is_finite()
    }
}

/// A place to fly to, East, North and Up in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Waypoint {
    /// East, North and Up in metres.
    pub position: Vector3<f64>,
}

/// A beacon's index in the hunt's list of beacons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(transparent))]
pub struct BeaconId(pub u16);

#[cfg(test)]
mod tests {
    use core::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn nose_and_right_side_follow_the_angles() {
        let [east, north, up] = [Vector3::x(), Vector3::y(), Vector3::z()];
        let level = Pose::level(Vector3::zeros(), FRAC_PI_2);
        assert!((level.to_body(&north) - Vector3::x()).norm() < 1e-15, "the nose is to the North");
        assert!((level.to_body(&east) + Vector3::y()).norm() < 1e-15, "East is to the right");
        let climbing = Pose { pitch: 0.3, ..level };
        let nose = north * 0.3_f64.cos() + up * 0.3_f64.sin();
        assert!((climbing.to_body(&nose) - Vector3::x()).norm() < 1e-15, "the nose is up");
        let banked = Pose { roll: 0.3, ..level };
        let right = east * 0.3_f64.cos() - up * 0.3_f64.sin();
        assert!((banked.to_body(&right) + Vector3::y()).norm() < 1e-15, "the right side is down");
        let any = Pose { heading: 1.0, pitch: -0.4, roll: 0.7, ..level };
        let body = any.to_body(&Vector3::new(1.0, 2.0, 3.0));
        assert!((body.norm_squared() - 14.0).abs() < 1e-12, "turning keeps lengths");
    }
}
