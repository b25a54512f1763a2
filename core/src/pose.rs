use nalgebra::Vector3;

/// A drone's place in the local East-North-Up frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Pose {
    /// East, North and Up in metres.
    pub position: Vector3<f64>,
    /// The nose, in radians counter-clockwise from East.
    pub heading: f64,
}

impl Pose {
    /// A pose with the nose to the East.
    #[must_use]
    pub fn at(east: f64, north: f64, up: f64) -> Self {
        Self { position: Vector3::new(east, north, up), heading: 0.0 }
    }

    /// Whether every number in it is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.heading.is_finite() && self.position.iter().all(|c| c.is_finite())
    }
}

/// A place to fly to, East, North and Up in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Waypoint {
    /// East, North and Up in metres.
    pub position: Vector3<f64>,
}

/// Which of the hunt's beacons is meant: its place in the hunt's list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(transparent))]
pub struct BeaconId(pub u16);
