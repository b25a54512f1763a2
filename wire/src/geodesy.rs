//! The edge between the world's units and ours: the one place where WGS84 and compass degrees
//! become East-North-Up metres and radians counter-clockwise from East.

use std::f64::consts::FRAC_PI_2;

use foxhunt_core::angle;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Semi-major axis of the WGS84 ellipsoid, in metres.
const SEMI_MAJOR_M: f64 = 6_378_137.0;

/// Flattening of the WGS84 ellipsoid.
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// Square of its first eccentricity.
const ECCENTRICITY_SQUARE: f64 = FLATTENING * (2.0 - FLATTENING);

/// A place on or above the WGS84 ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Geodetic {
    /// Latitude in degrees, North positive, within ±90.
    pub lat_deg: f64,
    /// Longitude in degrees, East positive, within −180 to 360.
    pub lon_deg: f64,
    /// Height above the ellipsoid in metres.
    pub alt_m: f64,
}

impl Geodetic {
    /// A place whose numbers are possible.
    ///
    /// # Errors
    ///
    /// [`GeodesyError`] names the number that is not.
    pub fn new(lat_deg: f64, lon_deg: f64, alt_m: f64) -> Result<Self, GeodesyError> {
        if !(-90.0..=90.0).contains(&lat_deg) {
            return Err(GeodesyError::Latitude { lat_deg, swapped: lon_deg.abs() <= 90.0 });
        }
        if !(-180.0..=360.0).contains(&lon_deg) {
            return Err(GeodesyError::Longitude { lon_deg });
        }
        if !alt_m.is_finite() {
            return Err(GeodesyError::Altitude { alt_m });
        }
        Ok(Self { lat_deg, lon_deg, alt_m })
    }

    /// The place at Earth-centred, Earth-fixed coordinates in metres; `None` where these are not
    /// finite, or so deep in the Earth that no receiver is there.
    ///
    /// ```
    /// use foxhunt_wire::geodesy::Geodetic;
    ///
    /// let null_island = Geodetic::from_ecef(6_378_147.0, 0.0, 0.0).expect("10 m above it");
    /// assert!(null_island.lat_deg.abs() < 1e-9 && (null_island.alt_m - 10.0).abs() < 1e-6);
    /// assert_eq!(Geodetic::from_ecef(0.0, 0.0, 0.0), None);
    /// ```
    #[must_use]
    pub fn from_ecef(x_m: f64, y_m: f64, z_m: f64) -> Option<Self> {
        // The poles are 6,356,752 m from the centre.
        let radius_m = libm::hypot(libm::hypot(x_m, y_m), z_m);
        if !radius_m.is_finite() || radius_m < 6_300_000.0 {
            return None;
        }
        let place = Self::of_ecef(&Vector3::new(x_m, y_m, z_m));
        Self::new(place.lat_deg, place.lon_deg, place.alt_m).ok()
    }

    /// Earth-centred, Earth-fixed coordinates, in metres: the reverse of
    /// [`from_ecef`](Self::from_ecef).
    #[must_use]
    pub fn to_ecef(self) -> Vector3<f64> {
        let (sin_lat, cos_lat) = libm::sincos(self.lat_deg.to_radians());
        let (sin_lon, cos_lon) = libm::sincos(self.lon_deg.to_radians());
        let normal_m = normal_m(sin_lat);
        let across_m = (normal_m + self.alt_m) * cos_lat;
        let up_m = (normal_m * (1.0 - ECCENTRICITY_SQUARE) + self.alt_m) * sin_lat;
        Vector3::new(across_m * cos_lon, across_m * sin_lon, up_m)
    }

    /// Converts Earth-centred, Earth-fixed coordinates in metres, by the reduced latitude (Bowring
    /// 1976, "Transformation from spatial to geographical coordinates").
    fn of_ecef(ecef: &Vector3<f64>) -> Self {
        let semi_minor_m = SEMI_MAJOR_M * (1.0 - FLATTENING);
        let second_square = ECCENTRICITY_SQUARE / (1.0 - ECCENTRICITY_SQUARE);
        let across_m = libm::hypot(ecef.x, ecef.y);
        let mut lat = libm::atan2(ecef.z, across_m * (1.0 - ECCENTRICITY_SQUARE));
        // The tests hold three steps to 10⁻⁷ m, up to 30 km above the ellipsoid.
        for _ in 0..3 {
            let reduced = libm::atan2((1.0 - FLATTENING) * libm::sin(lat), libm::cos(lat));
            let (sin, cos) = libm::sincos(reduced);
            lat = libm::atan2(
                ecef.z + second_square * semi_minor_m * sin * sin * sin,
                across_m - ECCENTRICITY_SQUARE * SEMI_MAJOR_M * cos * cos * cos,
            );
        }
        let (sin, cos) = libm::sincos(lat);
        let on_ellipsoid_m = SEMI_MAJOR_M * SEMI_MAJOR_M / normal_m(sin);
        Self {
            lat_deg: lat.to_degrees(),
            lon_deg: libm::atan2(ecef.y, ecef.x).to_degrees(),
            alt_m: across_m * cos + ecef.z * sin - on_ellipsoid_m,
        }
    }
}

/// Radius of curvature across the meridian, in metres.
fn normal_m(sin_lat: f64) -> f64 {
    SEMI_MAJOR_M / (1.0 - ECCENTRICITY_SQUARE * sin_lat * sin_lat).sqrt()
}

/// Reason for refusing a place.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GeodesyError {
    /// The latitude is not between the poles.
    #[error(
        "the latitude {lat_deg}° is not within ±90°{}",
        if *swapped { "; latitude and longitude look swapped" } else { "" }
    )]
    Latitude {
        /// The latitude.
        lat_deg: f64,
        /// True if the longitude would pass for a latitude.
        swapped: bool,
    },
    /// The longitude is not within -180° to 360°.
    #[error("the longitude {lon_deg}° is not within -180° to 360°")]
    Longitude {
        /// The longitude.
        lon_deg: f64,
    },
    /// The altitude is NaN or infinite.
    #[error("the altitude {alt_m} m is not a finite number")]
    Altitude {
        /// The altitude.
        alt_m: f64,
    },
}

/// An East-North-Up frame that touches the ellipsoid's parallel surface at its origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalFrame {
    origin: Geodetic,
}

impl LocalFrame {
    /// The frame with this origin.
    ///
    /// # Errors
    ///
    /// [`GeodesyError`] as [`Geodetic::new`].
    pub fn new(origin: Geodetic) -> Result<Self, GeodesyError> {
        Ok(Self { origin: Geodetic::new(origin.lat_deg, origin.lon_deg, origin.alt_m)? })
    }

    /// Origin of the frame.
    #[must_use]
    pub fn origin(&self) -> Geodetic {
        self.origin
    }

    /// East, North and Up of a place, in metres. The frame is flat: Up falls below the height
    /// above ground by 8 cm at 1 km and 8 m at 10 km.
    #[must_use]
    pub fn to_local(&self, place: &Geodetic) -> Vector3<f64> {
        self.axes() * (place.to_ecef() - self.origin.to_ecef())
    }

    /// The place at East, North and Up in metres; longitude within ±180°.
    #[must_use]
    pub fn to_geodetic(&self, local: &Vector3<f64>) -> Geodetic {
        Geodetic::of_ecef(&(self.origin.to_ecef() + self.axes().tr_mul(local)))
    }

    /// East, North and Up of the frame in Earth-centred, Earth-fixed coordinates, one in a row.
    #[must_use]
    pub fn axes(&self) -> Matrix3<f64> {
        let (sin_lat, cos_lat) = libm::sincos(self.origin.lat_deg.to_radians());
        let (sin_lon, cos_lon) = libm::sincos(self.origin.lon_deg.to_radians());
        Matrix3::new(
            -sin_lon,
            cos_lon,
            0.0,
            -sin_lat * cos_lon,
            -sin_lat * sin_lon,
            cos_lat,
            cos_lat * cos_lon,
            cos_lat * sin_lon,
            sin_lat,
        )
    }

    /// Returns the direction in the frame, in radians counter-clockwise from East, of a horizontal
    /// line at a place that is given in degrees clockwise from true North there.
    ///
    /// Meridians converge: 100 km East of the origin at 60° North, North points 1.6° to the West of
    /// the frame's. The line is turned into the frame as the vector it is, so that it points where
    /// the chord to a target nearby does; one from a target at the same height d away dips by
    /// d/2R, which turns it by less than d D/2R² at a distance D from the origin: 0.003° at 50 km
    /// and 80 km.
    ///
    /// ```
    /// use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
    /// let frame = LocalFrame::new(Geodetic { lat_deg: 60.0, lon_deg: 10.0, alt_m: 0.0 })?;
    /// let east_of_it = Geodetic { lon_deg: 11.8, ..frame.origin() };
    /// let north = frame.direction(&east_of_it, 0.0);
    /// assert!((north.to_degrees() - 91.56).abs() < 0.01);
    /// let east = frame.direction(&east_of_it, 90.0);
    /// assert!((frame.compass_deg(&east_of_it, east) - 90.0).abs() < 1e-9);
    /// # Ok::<(), foxhunt_wire::geodesy::GeodesyError>(())
    /// ```
    #[must_use]
    pub fn direction(&self, place: &Geodetic, deg_compass: f64) -> f64 {
        let (sin, cos) = libm::sincos(deg_compass.to_radians());
        let line = self.horizon(place) * Vector2::new(sin, cos);
        libm::atan2(line.y, line.x)
    }

    /// Returns the direction of a horizontal line at a place in degrees clockwise from true North
    /// there, in [0, 360): the reverse of [`direction`](Self::direction).
    #[must_use]
    pub fn compass_deg(&self, place: &Geodetic, radians: f64) -> f64 {
        let (sin, cos) = libm::sincos(radians);
        let line = self.horizon(place).lu().solve(&Vector2::new(cos, sin));
        // The horizon is singular for a place a quarter of Earth away alone.
        let line = line.unwrap_or_else(|| Vector2::new(cos, sin));
        radians_to_compass_deg(libm::atan2(line.y, line.x))
    }

    /// East and North of the frame of the East and the North at a place.
    fn horizon(&self, place: &Geodetic) -> Matrix2<f64> {
        let (sin, cos) = libm::sincos((place.lon_deg - self.origin.lon_deg).to_radians());
        let (own_sin, own_cos) = libm::sincos(place.lat_deg.to_radians());
        let (sin_0, cos_0) = libm::sincos(self.origin.lat_deg.to_radians());
        Matrix2::new(cos, -own_sin * sin, sin_0 * sin, sin_0 * own_sin * cos + cos_0 * own_cos)
    }
}

/// Degrees clockwise from North to radians counter-clockwise from East, in [−π, π).
///
/// ```
/// use foxhunt_wire::geodesy::compass_deg_to_radians;
/// let north = compass_deg_to_radians(0.0);
/// assert!((north - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// ```
#[must_use]
pub fn compass_deg_to_radians(deg_compass: f64) -> f64 {
    angle::wrap(FRAC_PI_2 - deg_compass.to_radians())
}

/// Radians counter-clockwise from East to degrees clockwise from North, in [0, 360).
#[must_use]
pub fn radians_to_compass_deg(radians: f64) -> f64 {
    let deg = angle::wrap(FRAC_PI_2 - radians).to_degrees();
    let turned = if deg < 0.0 { deg + 360.0 } else { deg };
    // A hair west of North rounds up to a full turn.
    if turned >= 360.0 { 0.0 } else { turned }
}

/// The meridian convergence of UTM at a place: the angle of its zone's northing east of true North,
/// in degrees (Snyder 1987, eq. 8-12, of the sphere: the ellipsoid's differs by less than 10⁻⁴°).
#[must_use]
pub fn grid_convergence_deg(place: &Geodetic) -> f64 {
    let east = f64::to_radians(place.lon_deg - utm_central_meridian_deg(place));
    libm::atan(libm::tan(east) * libm::sin(place.lat_deg.to_radians())).to_degrees()
}

/// The central meridian of a place's UTM zone, with the exceptions for Norway and Svalbard.
fn utm_central_meridian_deg(place: &Geodetic) -> f64 {
    let lon_deg = (place.lon_deg + 180.0).rem_euclid(360.0) - 180.0;
    let within = |west, east| (west..east).contains(&lon_deg);
    if (56.0..64.0).contains(&place.lat_deg) && within(3.0, 12.0) {
        9.0
    } else if (72.0..=84.0).contains(&place.lat_deg) && within(0.0, 42.0) {
        match lon_deg {
            ..9.0 => 3.0,
            9.0..21.0 => 15.0,
            21.0..33.0 => 27.0,
            _ => 39.0,
        }
    } else {
        (lon_deg / 6.0).floor() * 6.0 + 3.0
    }
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use std::f64::consts::{FRAC_PI_4, PI};

    use proptest::prelude::*;

    use super::*;

    fn frame(lat_deg: f64, lon_deg: f64, alt_m: f64) -> LocalFrame {
        LocalFrame::new(Geodetic { lat_deg, lon_deg, alt_m }).expect("a place on Earth")
    }

    #[test]
    fn agrees_with_pymap3d() {
        // place, origin, and what geodetic2enu of pymap3d 3.2.0 makes of them.
        let cases = [
            (
                [35.728_067_09, -78.697_303_98, 1.5],
                [35.727_370_46, -78.696_220_96, 0.0],
                [-97.983_237_163_670_5, 77.294_417_041_590_75, 1.498_778_339_496_084_3],
            ),
            (
                [-33.8688, 151.2093, 58.0],
                [-33.9, 151.1, 20.0],
                [10_113.240_632_846_282, 3_455.364_621_626_061_3, 29.051_242_415_689_33],
            ),
            (
                [50.1, 14.5, 400.0],
                [50.0755, 14.4378, 200.0],
                [4_450.496_730_565_858, 2_727.177_043_629_705, 197.866_963_567_955_28],
            ),
            (
                [0.001, 179.9995, 10.0],
                [-0.001, -179.9995, 0.0],
                [-111.319_665_303_561_45, 221.148_900_647_399_16, 9.995_168_776_246_304],
            ),
        ];
        for (place, origin, expected) in cases {
            let [lat_deg, lon_deg, alt_m] = place;
            let local = frame(origin[0], origin[1], origin[2]).to_local(&Geodetic {
                lat_deg,
                lon_deg,
                alt_m,
            });
            // Earth's radius times a few ulps of the coordinates.
            assert!((local - Vector3::from(expected)).norm() < 1e-8, "{place:?}: {local}");
        }
    }

    #[test]
    fn the_compass_has_four_quadrants() {
        let table = [
            (0.0, FRAC_PI_2),
            (45.0, FRAC_PI_4),
            (90.0, 0.0),
            (135.0, -FRAC_PI_4),
            (180.0, -FRAC_PI_2),
            (225.0, -3.0 * FRAC_PI_4),
            (270.0, -PI),
            (315.0, 3.0 * FRAC_PI_4),
            (359.0, (91.0_f64).to_radians()),
        ];
        for (compass, radians) in table {
            let made = compass_deg_to_radians(compass);
            assert!(abs_diff_eq!(made, radians, epsilon = 1e-14), "{compass}° made {made}");
            let back = radians_to_compass_deg(radians);
            assert!(abs_diff_eq!(back, compass, epsilon = 1e-12), "{radians} made {back}°");
        }
        assert!(radians_to_compass_deg(FRAC_PI_2.next_up()) < 360.0);
    }

    #[test]
    fn grids_converge_as_their_projection_does() {
        // By differences of Krüger's series of the projection itself (Karney 2011, eq. 35), in
        // Python.
        for (lat_deg, lon_deg, expected) in [
            (37.0, -8.0, 0.601_855),
            (35.727_451, -78.695_974, 1.345_875),
            (50.0755, 14.4378, -0.431_152),
            (-33.8688, 151.2093, 0.998_172),
            (60.39, 5.32, -3.200_503),
            (78.2, 20.8, 5.678_241),
            (78.2, 15.6, 0.587_321),
            (50.0755, 374.4378, -0.431_152),
            (0.0, 1.5, 0.0),
        ] {
            let made = grid_convergence_deg(&Geodetic { lat_deg, lon_deg, alt_m: 0.0 });
            assert!(abs_diff_eq!(made, expected, epsilon = 1e-4), "{lat_deg}, {lon_deg}: {made}");
        }
    }

    #[test]
    fn impossible_places_are_refused() {
        assert_eq!(
            Geodetic::new(-111.6, 35.2, 0.0),
            Err(GeodesyError::Latitude { lat_deg: -111.6, swapped: true })
        );
        let error = Geodetic::new(-111.6, 35.2, 0.0).expect_err("swapped").to_string();
        assert!(error.contains("-111.6") && error.contains("swapped"), "{error}");
        assert_eq!(Geodetic::new(0.0, 400.0, 0.0), Err(GeodesyError::Longitude { lon_deg: 400.0 }));
        assert!(Geodetic::new(f64::NAN, 0.0, 0.0).is_err());
        assert!(Geodetic::new(0.0, f64::NAN, 0.0).is_err());
        assert!(Geodetic::new(0.0, 0.0, f64::INFINITY).is_err());
        assert!(LocalFrame::new(Geodetic { lat_deg: 91.0, lon_deg: 0.0, alt_m: 0.0 }).is_err());
    }

    /// East and North of the direction to a target over the ground, by the azimuth of the vertical
    /// plane through it.
    fn azimuth_deg(from: &Geodetic, to: &Geodetic) -> f64 {
        let way = LocalFrame::new(*from).expect("a place on Earth").to_local(to);
        radians_to_compass_deg(way.y.atan2(way.x))
    }

    #[test]
    fn bearings_over_140_km_meet_within_metres() {
        // Azimuths of four stations about a transmitter at 60° North, computed apart to 10⁻⁴°.
        let target = Geodetic { lat_deg: 60.3, lon_deg: 11.5, alt_m: 0.0 };
        let stations = [
            (60.0, 10.0, 67.4923),
            (60.5, 10.3, 108.0947),
            (60.1, 12.6, 290.5410),
            (60.6, 12.5, 239.1654),
        ];
        let frame = frame(60.0, 10.0, 0.0);
        let truth = frame.to_local(&target);
        for (lat_deg, lon_deg, azimuth) in stations {
            let station = Geodetic { lat_deg, lon_deg, alt_m: 0.0 };
            assert_abs_diff_eq!(azimuth_deg(&station, &target), azimuth, epsilon = 1e-4);
            let way = (truth - frame.to_local(&station)).xy();
            let angle = frame.direction(&station, azimuth);
            let off_m = way.norm() * angle::wrap(way.y.atan2(way.x) - angle);
            // d² D/2R²: 70 km away from a station 140 km from the origin.
            assert!(abs_diff_eq!(off_m, 0.0, epsilon = 9.0), "{azimuth}: {off_m} m");
            let as_before = compass_deg_to_radians(azimuth);
            let off_m = way.norm() * angle::distance(way.y.atan2(way.x), as_before);
            assert!(!(1.0..=100.0).contains(&off_m), "{azimuth}: {off_m} m");
        }
    }

    proptest! {
        #[test]
        fn directions_and_back(
            lat in -80.0..80.0f64, lon in -180.0..180.0f64, d_lat in -1.0..1.0f64,
            d_lon in -2.0..2.0f64, deg in 0.0..359.9f64,
        ) {
            let frame = frame(lat, lon, 0.0);
            let place = Geodetic { lat_deg: lat + d_lat, lon_deg: lon + d_lon, alt_m: 0.0 };
            let back = frame.compass_deg(&place, frame.direction(&place, deg));
            let apart = (back - deg + 180.0).rem_euclid(360.0) - 180.0;
            prop_assert!(apart.abs() < 1e-9, "{deg} came back as {back}");
        }

        #[test]
        fn a_target_lies_where_its_azimuth_points(
            lat in -75.0..75.0f64, lon in -180.0..180.0f64, east in -60e3..60e3f64,
            north in -60e3..60e3f64, way_east in -30e3..30e3f64, way_north in -30e3..30e3f64,
        ) {
            let frame = frame(lat, lon, 0.0);
            let ground = |east: f64, north: f64| {
                let place = frame.to_geodetic(&Vector3::new(east, north, 0.0));
                Geodetic { alt_m: 0.0, ..place }
            };
            let from = ground(east, north);
            let to = ground(east + way_east, north + way_north);
            let azimuth = azimuth_deg(&from, &to);
            let way = (frame.to_local(&to) - frame.to_local(&from)).xy();
            prop_assume!(way.norm() > 100.0);
            let apart = angle::distance(frame.direction(&from, azimuth), way.y.atan2(way.x));
            // d D/2R², with R at its least.
            let most = way.norm() * east.hypot(north) / (2.0 * 6.33e6 * 6.33e6) + 1e-7;
            prop_assert!(apart < 1.05 * most, "{apart} of {most}");
        }

        #[test]
        fn local_and_back(
            lat in -89.0..89.0f64, lon in -180.0..180.0f64, alt in 0.0..3_000.0f64,
            east in -20_000.0..20_000.0f64, north in -20_000.0..20_000.0f64, up in 0.0..500.0f64,
        ) {
            let frame = frame(lat, lon, alt);
            let local = Vector3::new(east, north, up);
            let back = frame.to_local(&frame.to_geodetic(&local));
            prop_assert!((back - local).norm() < 1e-7, "{local} came back as {back}");
        }

        #[test]
        fn another_code_has_these_places(
            lat in -90.0..90.0f64, lon in -180.0..180.0f64, alt in -100.0..30_000.0f64,
            d_lat in -1.0..1.0f64, d_lon in -1.0..1.0f64,
        ) {
            let place = Geodetic {
                lat_deg: (lat + d_lat).clamp(-90.0, 90.0), lon_deg: lon + d_lon, alt_m: alt,
            };
            let frame = frame(lat, lon, 0.0);
            let local = frame.to_local(&place);
            let (east, north, up) = map_3d::geodetic2enu(
                place.lat_deg.to_radians(), place.lon_deg.to_radians(), alt, lat.to_radians(),
                lon.to_radians(), 0.0, map_3d::Ellipsoid::WGS84,
            );
            prop_assert!((local - Vector3::new(east, north, up)).norm() < 1e-7);
            let back = frame.to_geodetic(&local);
            let turned = (back.lon_deg - place.lon_deg + 180.0).rem_euclid(360.0) - 180.0;
            let metres = Vector3::new(
                turned * 111_320.0 * place.lat_deg.to_radians().cos(),
                (back.lat_deg - place.lat_deg) * 111_320.0,
                back.alt_m - place.alt_m,
            );
            prop_assert!(metres.norm() < 1e-7, "{place:?} came back as {back:?}");
        }

        #[test]
        fn compass_and_back(radians in -20.0..20.0f64) {
            let deg = radians_to_compass_deg(radians);
            prop_assert!((0.0..360.0).contains(&deg));
            prop_assert!(angle::distance(compass_deg_to_radians(deg), radians) < 1e-13);
        }
    }
}
