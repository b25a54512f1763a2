//! Magnetic declination: the direction of compasses.

use world_magnetic_model::{
    Error, GeomagneticField, WarningZone,
    time::Date,
    uom::si::{
        angle::degree,
        f32::{Angle, Length},
        length::meter,
    },
};

use crate::geodesy::Geodetic;

/// The Julian day of 1970-01-01.
const JULIAN_DAY_OF_1970: i32 = 2_440_588;

/// Reason that there is no declination.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DeclinationError {
    /// The model is not of this day.
    #[error("the World Magnetic Model covers 2020 to 2029; state a declination for other dates")]
    Date,
    /// The model is not of this place.
    #[error("the World Magnetic Model does not cover this place: {0}")]
    Place(Error),
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
    #[expect(clippy::cast_possible_truncation, reason = "it saturates, and such days are refused")]
    let day = (unix_s / 86_400.0).floor() as i32;
    if unix_s.is_nan() {
        return Err(DeclinationError::Date);
    }
    let date = Date::from_julian_day(day.saturating_add(JULIAN_DAY_OF_1970));
    let date = date.map_err(|_| DeclinationError::Date)?;
    let east_deg = if place.lon_deg > 180.0 { place.lon_deg - 360.0 } else { place.lon_deg };
    #[expect(clippy::cast_possible_truncation, reason = "f32 is 10⁻⁵° here")]
    let (height, lat, lon) = (place.alt_m as f32, place.lat_deg as f32, east_deg as f32);
    let field = GeomagneticField::new(
        Length::new::<meter>(height),
        Angle::new::<degree>(lat),
        Angle::new::<degree>(lon),
        date,
    )
    .map_err(|error| match error {
        Error::DateOutsideOfValidityRange { .. } => DeclinationError::Date,
        error => DeclinationError::Place(error),
    })?;
    match field.declination_warning() {
        Some(WarningZone::BlackoutZone) => Err(DeclinationError::NearPole),
        _ => Ok(f64::from(field.declination().get::<degree>())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2025-01-01 and 2027-07-02, noon.
    const DAYS: [f64; 2] = [1_735_732_800.0, 1_814_529_600.0];

    fn at(lat_deg: f64, lon_deg: f64, alt_m: f64, unix_s: f64) -> Result<f64, DeclinationError> {
        declination_deg(&Geodetic { lat_deg, lon_deg, alt_m }, unix_s)
    }

    #[test]
    fn agrees_with_the_published_test_values() {
        // WMM2025_TEST_VALUES.txt (NOAA NCEI, December 2024): latitude, longitude, height in
        // metres, declination at 2025.0 and at 2027.5.
        for (lat, lon, alt_m, expected) in [
            (80.0, 0.0, 0.0, [1.28, 2.59]),
            (0.0, 120.0, 0.0, [-0.16, -0.24]),
            (-80.0, 240.0, 0.0, [68.78, 68.49]),
            (80.0, 0.0, 100e3, [0.85, 2.16]),
            (0.0, 120.0, 100e3, [-0.15, -0.23]),
            (-80.0, -120.0, 100e3, [68.21, 67.93]),
        ] {
            for (day, expected) in DAYS.into_iter().zip(expected) {
                let made = at(lat, lon, alt_m, day).expect("within the model");
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
        assert!(matches!(at(50.0, 14.0, 1e7, DAYS[0]), Err(DeclinationError::Place(_))));
        assert!(matches!(at(f64::NAN, 14.0, 0.0, DAYS[0]), Err(DeclinationError::Place(_))));
        // 86° N, 139° E is where the dip pole was in 2025.
        assert_eq!(at(86.0, 139.0, 0.0, DAYS[0]), Err(DeclinationError::NearPole));
    }
}
