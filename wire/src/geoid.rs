//! Height of mean sea level above the ellipsoid.

use crate::geodesy::Geodetic;

/// Standard deviation in metres of [`geoid_height_m`] against the full EGM96 over the whole Earth.
///
/// Measured at 2000 places spread evenly: 1.47 m, 12.8 m at most (New Britain), and more than 5 m
/// at 2 % of the places.
pub const GEOID_SIGMA_M: f64 = 1.5;

/// The height of the geoid, which is mean sea level, above the WGS84 ellipsoid at a place, in
/// metres: what a height above the sea lacks to be one above the ellipsoid.
///
/// The table is EGM2008 (NGA) at every third degree, with linear interpolation. The height of the
/// place does not matter. A latitude beyond the poles counts as that of the pole.
///
/// ```
/// use foxhunt_wire::{geodesy::Geodetic, geoid::geoid_height_m};
///
/// let prague = Geodetic::new(50.0755, 14.4378, 0.0)?;
/// assert!((geoid_height_m(&prague) - 44.7).abs() < 1.5);
/// # Ok::<(), foxhunt_wire::geodesy::GeodesyError>(())
/// ```
#[must_use]
pub fn geoid_height_m(place: &Geodetic) -> f64 {
    let lon_deg = (place.lon_deg + 180.0).rem_euclid(360.0) - 180.0;
    let lat_deg = place.lat_deg.clamp(-90.0, 90.0);
    #[expect(clippy::cast_possible_truncation, reason = "f32 is 10⁻⁵° here")]
    let [lat, lon] = [lat_deg, lon_deg].map(|degrees| degrees as f32);
    // Both are in range unless they are NaN, which no place is.
    egm2008::geoid_height(lat, lon).map_or(0.0, f64::from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Test points of the program F477 for EGM96 (NGA, INPUT.DAT and OUTF477.DAT): latitude,
    /// longitude and height in metres.
    const PUBLISHED: [(f64, f64, f64); 6] = [
        (38.628_155, 269.779_155, -31.628),
        (-14.621_217, 305.021_114, -2.969),
        (46.874_319, 102.448_729, -43.575),
        (-23.617_446, 133.874_712, 15.871),
        (38.625_473, 359.999_500, 50.066),
        (-0.466_744, 0.002_300, 17.329),
    ];

    fn at(lat_deg: f64, lon_deg: f64) -> f64 {
        geoid_height_m(&Geodetic { lat_deg, lon_deg, alt_m: 0.0 })
    }

    #[test]
    fn agrees_with_the_published_test_points() {
        for (lat, lon, expected) in PUBLISHED {
            // The greatest difference is 1.14 m.
            assert!((at(lat, lon) - expected).abs() < 1.2, "{lat}, {lon}: {}", at(lat, lon));
        }
    }

    #[test]
    fn places_at_the_edges_have_a_height() {
        assert_abs_diff_eq!(at(50.0, 374.5), at(50.0, 14.5), epsilon = 1e-4);
        assert_abs_diff_eq!(at(10.0, 180.0), at(10.0, -180.0), epsilon = 1e-4);
        assert_abs_diff_eq!(at(90.0, 0.0), 14.9, epsilon = 0.1);
        assert_abs_diff_eq!(at(90.5, 77.0), 14.9, epsilon = 0.1);
        assert_abs_diff_eq!(at(-90.0, 0.0), -30.15, epsilon = 0.1);
        assert_abs_diff_eq!(at(f64::NAN, 0.0), 0.0, epsilon = 0.0);
    }
}
