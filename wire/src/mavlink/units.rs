use std::f64::consts::FRAC_PI_2;

use foxhunt_core::angle;
use nalgebra::Vector3;

use crate::geodesy::{GeodesyError, Geodetic, LocalFrame};

/// MAVLink's yaw, in radians clockwise from North, in radians counter-clockwise from East.
#[must_use]
pub fn heading_of_yaw(yaw: f64) -> f64 {
    angle::wrap(FRAC_PI_2 - yaw)
}

/// A heading in radians counter-clockwise from East as MAVLink's yaw, in [−π, π).
#[must_use]
pub fn yaw_of_heading(heading: f64) -> f64 {
    angle::wrap(FRAC_PI_2 - heading)
}

/// East, North, Up as North, East, Down, and the other way round: it is its own inverse.
#[must_use]
pub fn ned_of_enu(enu: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(enu.y, enu.x, -enu.z)
}

/// Degrees of latitude or longitude from the 1e-7 degrees of a message.
#[must_use]
pub fn degrees_of_e7(e7: i32) -> f64 {
    f64::from(e7) * 1e-7
}

/// Degrees of latitude or longitude in 1e-7 degrees: a step of a centimetre.
#[must_use]
pub fn e7_of_degrees(deg: f64) -> i32 {
    whole(deg * 1e7)
}

/// The nearest whole number, at most as large as an `i32` holds; 0 for NaN.
#[must_use]
pub fn whole(value: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "it saturates, as documented")]
    let whole = value.round() as i32;
    whole
}

/// The frame that all drones of a hunt share over ground, and the launch place of one of them above
/// it: East and North count from a common origin, Up from where the drone was launched.
///
/// Heights do not enter East and North: all places are taken at the ellipsoid, which changes
/// distances by 16 parts in a million at 100 m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonFrame {
    frame: LocalFrame,
}

impl CommonFrame {
    /// The frame about an origin in degrees.
    ///
    /// # Errors
    ///
    /// Returns [`GeodesyError`] if latitude or longitude is out of range.
    pub fn new(lat_deg: f64, lon_deg: f64) -> Result<Self, GeodesyError> {
        Ok(Self { frame: LocalFrame::new(Geodetic::new(lat_deg, lon_deg, 0.0)?)? })
    }

    /// Returns the origin of the frame.
    #[must_use]
    pub fn origin(&self) -> Geodetic {
        self.frame.origin()
    }

    /// East and North of a place in degrees, with an Up in metres above the launch place.
    #[must_use]
    pub fn to_local(&self, lat_deg: f64, lon_deg: f64, up: f64) -> Vector3<f64> {
        let ground = self.frame.to_local(&Geodetic { lat_deg, lon_deg, alt_m: 0.0 });
        Vector3::new(ground.x, ground.y, up)
    }

    /// Latitude and longitude in degrees of a place over ground.
    #[must_use]
    pub fn to_degrees(&self, local: &Vector3<f64>) -> (f64, f64) {
        // On the ellipsoid, which falls away below the flat frame.
        let mut on_plane = Vector3::new(local.x, local.y, 0.0);
        let mut place = self.frame.to_geodetic(&on_plane);
        on_plane.z -= place.alt_m;
        place = self.frame.to_geodetic(&on_plane);
        (place.lat_deg, place.lon_deg)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn yaw_has_four_quadrants_and_down_is_below() {
        for (yaw, heading) in
            [(0.0, FRAC_PI_2), (FRAC_PI_2, 0.0), (PI, -FRAC_PI_2), (-FRAC_PI_2, -PI)]
        {
            assert!(angle::distance(heading_of_yaw(yaw), heading) < 1e-15);
            assert!(angle::distance(yaw_of_heading(heading), yaw) < 1e-15);
        }
        assert_eq!(ned_of_enu(&Vector3::new(1.0, 2.0, 3.0)), Vector3::new(2.0, 1.0, -3.0));
        assert_eq!(whole(f64::NAN), 0);
        assert_eq!(whole(1e12), i32::MAX);
        assert_eq!(e7_of_degrees(-35.363_261_9), -353_632_619);
    }

    proptest! {
        #[test]
        fn local_and_back(
            lat in -80.0..80.0f64, lon in -179.0..179.0f64,
            east in -5000.0..5000.0f64, north in -5000.0..5000.0f64, up in -50.0..500.0f64,
        ) {
            let frame = CommonFrame::new(lat, lon).expect("a place");
            let local = Vector3::new(east, north, up);
            let (lat, lon) = frame.to_degrees(&local);
            prop_assert!((frame.to_local(lat, lon, up) - local).norm() < 1e-3);
            let coarse = (degrees_of_e7(e7_of_degrees(lat)), degrees_of_e7(e7_of_degrees(lon)));
            let back = frame.to_local(coarse.0, coarse.1, up);
            prop_assert!((back - local).norm() < 0.01, "{local} came back as {back}");
        }
    }
}
