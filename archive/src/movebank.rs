//! Places that were found, as Movebank takes them.

use std::io::Write;

use foxhunt_core::Ellipse;
use foxhunt_wire::geodesy::{Geodetic, LocalFrame, radians_to_compass_deg};
use nalgebra::{Vector2, Vector3};

use crate::recording::{RecordingError, utc};

/// The attributes of a fix, by their names in the Movebank Attribute Dictionary
/// (vocab.nerc.ac.uk/collection/MVB). Only Argos has axes of ellipses there, so the ellipse is
/// given as the box about it and in words.
const COLUMNS: [&str; 14] = [
    "tag-local-identifier",
    "timestamp",
    "start-timestamp",
    "end-timestamp",
    "location-lat",
    "location-long",
    "location-error-numerical",
    "location-error-percentile",
    "lat-lower",
    "lat-upper",
    "long-lower",
    "long-upper",
    "location-accuracy-comments",
    "sensor-type",
];

/// A transmitter's place in the plane of a local frame.
#[derive(Clone, Debug, PartialEq)]
pub struct MovebankFix {
    /// The tag's name.
    pub tag: String,
    /// Times of the first and the last reception, in seconds since 1970 (UTC).
    pub received: [f64; 2],
    /// East and North in metres.
    pub place: Vector2<f64>,
    /// The ellipse that holds it with 95 %, if there is one.
    pub ellipse_95: Option<Ellipse>,
}

/// Writes places as a table with Movebank's names, for its import of radio-tracking data: the time
/// is the middle of the receptions, the error the ellipse's longer semi-axis.
///
/// # Errors
///
/// [`RecordingError::Write`] when `out` fails.
pub fn write_movebank(
    out: impl Write,
    frame: &LocalFrame,
    fixes: &[MovebankFix],
) -> Result<(), RecordingError> {
    let failed = |error: csv::Error| RecordingError::Write { source: error.into() };
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record(COLUMNS).map_err(failed)?;
    let on_earth = |place: Vector2<f64>| -> Geodetic {
        frame.to_geodetic(&Vector3::new(place.x, place.y, 0.0))
    };
    let degrees = |value: f64| format!("{value:.7}");
    for fix in fixes {
        let [first, last] = fix.received;
        let place = on_earth(fix.place);
        let mut row = vec![
            fix.tag.clone(),
            utc(0.5 * (first + last)),
            utc(first),
            utc(last),
            degrees(place.lat_deg),
            degrees(place.lon_deg),
        ];
        match &fix.ellipse_95 {
            None => row.extend(std::iter::repeat_n(String::new(), 7)),
            Some(ellipse) => {
                let (sin, cos) = libm::sincos(ellipse.orientation);
                let major = ellipse.semi_major;
                let minor = ellipse.semi_minor;
                let reach = Vector2::new(
                    libm::hypot(major * cos, minor * sin),
                    libm::hypot(major * sin, minor * cos),
                );
                let [low, high] = [fix.place - reach, fix.place + reach].map(on_earth);
                let along = radians_to_compass_deg(ellipse.orientation).rem_euclid(180.0);
                row.extend([format!("{major:.1}"), "95".to_owned()]);
                row.extend([low.lat_deg, high.lat_deg, low.lon_deg, high.lon_deg].map(degrees));
                row.push(format!(
                    "95 % ellipse: semi-axes {major:.1} m and {minor:.1} m, the longer one \
                     {along:.0} degrees clockwise from North; the bounds are those of the ellipse"
                ));
            }
        }
        row.push("radio-transmitter".to_owned());
        csv.write_record(row).map_err(failed)?;
    }
    csv.flush().map_err(|source| RecordingError::Write { source })
}
