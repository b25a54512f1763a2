//! Magnetic declination: the direction of compasses.

mod coefficients;

use coefficients::{Coefficients, DEGREE, WMM2020, WMM2025};

use crate::geodesy::Geodetic;

/// The day of 2020-01-01 since 1970, the first of the models.
const DAY_OF_2020: f64 = 18_262.0;

/// Mean radius of the Earth that the models are written for, in metres.
const RADIUS_M: f64 = 6_371_200.0;

/// Heights above the ellipsoid that the models are made for, in metres.
const HEIGHTS_M: std::ops::RangeInclusive<f64> = -1_000.0..=850_000.0;

/// Strength of the field along the ground below which compasses are unusable, in nT.
const BLACKOUT_NT: f64 = 2_000.0;

/// Degrees and orders as numbers.
const ORDERS: [f64; DEGREE + 1] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0];

/// Least cosine of a latitude, with which East and North stay defined at the poles.
const POLE: f64 = 1e-8;

/// Reason that there is no declination.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DeclinationError {
    /// The model is not of this day.
    #[error("the World Magnetic Model covers 2020 to 2029; state a declination for other dates")]
    Date,
    /// The model is not of this place.
    #[error(
        "the World Magnetic Model covers heights of -1 to 850 km; this place is at {lat_deg}°, \
         {lon_deg}°, {alt_m} m"
    )]
    Place {
        /// Latitude in degrees.
        lat_deg: f64,
        /// Longitude in degrees.
        lon_deg: f64,
        /// Height above the ellipsoid in metres.
        alt_m: f64,
    },
    /// The field is too flat for compasses (less than 2000 nT along the ground).
    #[error("a compass is unusable this close to a magnetic pole")]
    NearPole,
}

/// The magnetic declination at a place: the angle of a compass east of true North, in degrees.
///
/// By the World Magnetic Model of the day, WMM2020 or WMM2025 (Chulliat et al. 2020, 2025; NOAA and
/// BGS), which knows the main field: σ is some 0.3° to 0.5° at middle latitudes, and what lies near
/// the compass is not in it. The day is given by any of its seconds since 1970, UTC.
///
/// # Errors
///
/// [`DeclinationError`] for a day or a place that the model does not hold for.
///
/// ```
/// use foxhunt_wire::{declination::declination_deg, geodesy::Geodetic};
///
/// // Prague, on 2026-06-21.
/// let prague = Geodetic::new(50.0755, 14.4378, 200.0)?;
/// assert!((declination_deg(&prague, 1_782_000_000.0)? - 5.2).abs() < 0.3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn declination_deg(place: &Geodetic, unix_s: f64) -> Result<f64, DeclinationError> {
    let year = decimal_year(unix_s).ok_or(DeclinationError::Date)?;
    let &Geodetic { lat_deg, lon_deg, alt_m } = place;
    if Geodetic::new(lat_deg, lon_deg, alt_m).is_err() || !HEIGHTS_M.contains(&alt_m) {
        return Err(DeclinationError::Place { lat_deg, lon_deg, alt_m });
    }
    let [north, east] = if year < 2025.0 {
        along_ground(place, &WMM2020, year - 2020.0)
    } else {
        along_ground(place, &WMM2025, year - 2025.0)
    };
    if libm::hypot(north, east) < BLACKOUT_NT {
        return Err(DeclinationError::NearPole);
    }
    Ok(libm::atan2(east, north).to_degrees())
}

/// Year of a second since 1970 with its fraction; `None` before 2020 and from 2030 on.
fn decimal_year(unix_s: f64) -> Option<f64> {
    let mut days = unix_s / 86_400.0 - DAY_OF_2020;
    if days.is_nan() || days < 0.0 {
        return None;
    }
    for year in 2020..2030 {
        let length = if year % 4 == 0 { 366.0 } else { 365.0 };
        if days < length {
            return Some(f64::from(year) + days / length);
        }
        days -= length;
    }
    None
}

/// Components of the main field to the North and the East in nT, `years` after the epoch of its
/// coefficients (Chulliat et al. 2025, equations 4 to 17).
fn along_ground(place: &Geodetic, model: &[Coefficients], years: f64) -> [f64; 2] {
    let ecef = place.to_ecef();
    let radius = ecef.norm();
    let sine = ecef.z / radius;
    let cosine = (libm::hypot(ecef.x, ecef.y) / radius).max(POLE);
    // Of each order, the sine and the cosine of its multiple of the longitude.
    let turns: [(f64, f64); DEGREE + 1] =
        std::array::from_fn(|order| libm::sincos(place.lon_deg.to_radians() * ORDERS[order]));
    let mut of_degree = model;
    // The functions of two degrees below, and of one.
    let mut legendre = [[0.0; DEGREE + 1]; 2];
    legendre[1][0] = 1.0;
    let mut share = (RADIUS_M / radius) * (RADIUS_M / radius);
    // To the North, the East and down, on the sphere.
    let mut field = [0.0; 3];
    for (degree, n) in ORDERS.into_iter().enumerate().skip(1) {
        let (coefficients, rest) = of_degree.split_at(degree + 1);
        of_degree = rest;
        share *= RADIUS_M / radius;
        let current = next_legendre(degree, &legendre, sine, cosine);
        for (order, [g, h, g_change, h_change]) in coefficients.iter().enumerate() {
            let m = ORDERS[order];
            let g = g + years * g_change;
            let h = h + years * h_change;
            let (turn_sine, turn_cosine) = turns[order];
            let along = g * turn_cosine + h * turn_sine;
            let across = g * turn_sine - h * turn_cosine;
            // The derivative by the latitude.
            let slope = (libm::sqrt(n * n - m * m) * legendre[1][order]
                - n * sine * current[order])
                / cosine;
            field[0] -= share * along * slope;
            field[1] += share * m * across * current[order] / cosine;
            field[2] -= share * (n + 1.0) * along * current[order];
        }
        legendre = [legendre[1], current];
    }
    // From the sphere's North to that of the ellipsoid.
    let (tilt_sine, tilt_cosine) =
        libm::sincos(libm::atan2(sine, cosine) - place.lat_deg.to_radians());
    [field[0] * tilt_cosine - field[2] * tilt_sine, field[1]]
}

/// Associated Legendre functions of one degree, of each order, from the two degrees below, of the
/// sine of a latitude; normalised after Schmidt.
fn next_legendre(
    degree: usize,
    below: &[[f64; DEGREE + 1]; 2],
    sine: f64,
    cosine: f64,
) -> [f64; DEGREE + 1] {
    let n = ORDERS[degree];
    let mut made = [0.0; DEGREE + 1];
    for (order, value) in made.iter_mut().enumerate().take(degree) {
        let m = ORDERS[order];
        *value = ((2.0 * n - 1.0) * sine * below[1][order]
            - libm::sqrt((n - 1.0) * (n - 1.0) - m * m) * below[0][order])
            / libm::sqrt(n * n - m * m);
    }
    let scale = if degree == 1 { 1.0 } else { libm::sqrt((2.0 * n - 1.0) / (2.0 * n)) };
    made[degree] = scale * cosine * below[1][degree - 1];
    made
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2020-01-01, 2022-07-02, 2025-01-01 and 2027-07-02, noon.
    const DAYS: [f64; 4] = [1_577_880_000.0, 1_656_763_200.0, 1_735_732_800.0, 1_814_529_600.0];

    fn at(lat_deg: f64, lon_deg: f64, alt_m: f64, unix_s: f64) -> Result<f64, DeclinationError> {
        declination_deg(&Geodetic { lat_deg, lon_deg, alt_m }, unix_s)
    }

    #[test]
    fn agrees_with_the_published_test_values() {
        // WMM2020_TEST_VALUES.txt and WMM2025_TEST_VALUES.txt (NOAA NCEI, December 2019 and 2024):
        // latitude, longitude, height in metres, declination at each of the days, or the last two.
        for (lat, lon, alt_m, expected) in [
            (80.0, 0.0, 0.0, [-1.28, 0.01, 1.28, 2.59].as_slice()),
            (0.0, 120.0, 0.0, &[0.16, -0.06, -0.16, -0.24]),
            (-80.0, 240.0, 0.0, &[69.36, 69.13, 68.78, 68.49]),
            (80.0, 0.0, 100e3, &[0.85, 2.16]),
            (0.0, 120.0, 100e3, &[-0.15, -0.23]),
            (-80.0, -120.0, 100e3, &[68.21, 67.93]),
        ] {
            for (day, expected) in DAYS.iter().rev().zip(expected.iter().rev()) {
                let made = at(lat, lon, alt_m, *day).expect("within the model");
                // Values are published to 0.01°, and the day's middle is not the year's.
                assert!((made - expected).abs() < 0.008, "{lat}, {lon}, {alt_m}: {made}");
            }
        }
    }

    #[test]
    fn days_and_places_beyond_the_model_are_refused() {
        // The last second of 2019, the first of 2030, and neighbours within.
        for (day, within) in [
            (1_577_836_799.0, false),
            (1_577_836_800.0, true),
            (1_893_455_999.0, true),
            (1_893_456_000.0, false),
            (f64::NAN, false),
            (f64::INFINITY, false),
            (-1e300, false),
        ] {
            let made = at(50.0, 14.0, 0.0, day);
            assert_eq!(made.is_ok(), within, "{day}: {made:?}");
            assert!(within || made == Err(DeclinationError::Date), "{day}: {made:?}");
        }
        assert!(matches!(at(50.0, 14.0, 1e7, DAYS[2]), Err(DeclinationError::Place { .. })));
        assert!(matches!(at(f64::NAN, 14.0, 0.0, DAYS[2]), Err(DeclinationError::Place { .. })));
        // 86° N, 139° E is where the dip pole was in 2025.
        assert_eq!(at(86.0, 139.0, 0.0, DAYS[2]), Err(DeclinationError::NearPole));
    }

    #[test]
    fn poles_and_both_ways_around_the_world_are_places() {
        // At the pole, North is along the meridian that was asked for.
        let [at_0, at_90] = [0.0, 90.0].map(|lon| at(-90.0, lon, 0.0, DAYS[2]).expect("a place"));
        assert!(foxhunt_core::angle::wrap((at_90 - at_0 + 90.0).to_radians()).abs() < 1e-6);
        let [west, east] = [-60.0, 300.0].map(|lon| at(-30.0, lon, 0.0, DAYS[2]).expect("a place"));
        assert!((west - east).abs() < 1e-9, "{west}, {east}");
    }
}
