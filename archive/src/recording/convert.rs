use std::io::Write;

use foxhunt_core::Quantity;
use foxhunt_wire::geodesy::{LocalFrame, radians_to_compass_deg};
use nalgebra::Vector3;

use super::{Column, Record, Recording, RecordingError};

/// Text of a record in a column; [`None`] where it has nothing.
type Cell = fn(&Record, &Recording) -> Option<String>;

/// The columns of a converted recording. A number comes first: a name may begin like a comment.
const CELLS: [(Column, Cell); 31] = [
    (Column::TimeS, |record, of| shown(record.time.filter(|_| !of.is_in_utc()))),
    (Column::TimeUtc, |record, of| shown(record.time.filter(|_| of.is_in_utc()))),
    (Column::Turn, |record, _| shown(record.turn)),
    (Column::Drone, |record, _| Some(record.drone.to_string())),
    (Column::Beacon, |record, _| shown(record.beacon.as_deref())),
    (Column::LatDeg, |record, of| on_earth(record, of).map(|[lat, _]| lat)),
    (Column::LonDeg, |record, of| on_earth(record, of).map(|[_, lon]| lon)),
    (Column::AltAglM, |record, of| shown(of.frame().and(record.receiver()).map(|r| r.position.z))),
    (Column::EastM, |record, of| shown(local(record, of).map(|place| place.x))),
    (Column::NorthM, |record, of| shown(local(record, of).map(|place| place.y))),
    (Column::UpM, |record, of| shown(local(record, of).map(|place| place.z))),
    (Column::ReceiverSigmaM, |record, _| shown(record.receiver_sigma_m)),
    (Column::HeadingDegCompass, |record, of| {
        compass(record, of, record.receiver().map(|r| r.heading))
    }),
    (Column::PitchDeg, |record, _| shown(record.tilted.map(|pose| pose.pitch.to_degrees()))),
    (Column::RollDeg, |record, _| shown(record.tilted.map(|pose| pose.roll.to_degrees()))),
    (Column::BoresightDegCompass, |record, of| compass(record, of, record.boresight)),
    (Column::Position, |record, _| shown(record.position)),
    (Column::RssDbm, |record, of| shown(record.rss_dbm.filter(|_| of.is_calibrated()))),
    (Column::RssDb, |record, of| shown(record.rss_dbm.filter(|_| !of.is_calibrated()))),
    (Column::FloorDbm, |record, _| shown(record.floor_dbm)),
    (Column::CeilingDbm, |record, _| shown(record.ceiling_dbm)),
    (Column::BearingDegCompass, |record, of| compass(record, of, record.bearing.map(|b| b.angle))),
    (Column::BearingSigmaDeg, |record, _| {
        shown(record.bearing.and_then(|b| b.sigma).map(f64::to_degrees))
    }),
    (Column::RangeM, |record, _| {
        shown(record.known_range.or_else(|| value(record, Quantity::RANGE)))
    }),
    (Column::RangeSigmaM, |record, _| shown(sigma(record, Quantity::RANGE))),
    (Column::RangeDifferenceM, |record, _| shown(value(record, Quantity::RANGE_DIFFERENCE))),
    (Column::RangeDifferenceSigmaM, |record, _| shown(sigma(record, Quantity::RANGE_DIFFERENCE))),
    (Column::RssDifferenceDb, |record, _| shown(value(record, Quantity::RSS_DIFFERENCE))),
    (Column::RssDifferenceSigmaDb, |record, _| shown(sigma(record, Quantity::RSS_DIFFERENCE))),
    (Column::TruthLatDeg, |record, of| truth(record, of).map(|[lat, _]| lat)),
    (Column::TruthLonDeg, |record, of| truth(record, of).map(|[_, lon]| lon)),
];

/// The truth of recordings in local metres.
const LOCAL_TRUTH: [(Column, Cell); 2] = [
    (Column::TruthEastM, |record, of| shown(local_truth(record, of).map(|truth| truth.x))),
    (Column::TruthNorthM, |record, of| shown(local_truth(record, of).map(|truth| truth.y))),
];

fn shown(value: Option<impl ToString>) -> Option<String> {
    value.map(|value| value.to_string())
}

/// The angle clockwise from true North at the receiver, where its place on Earth is known.
fn compass(record: &Record, of: &Recording, angle: Option<f64>) -> Option<String> {
    let on_earth = of.frame().zip(record.receiver());
    shown(angle.map(|angle| match on_earth {
        Some((frame, receiver)) => frame.compass_deg(&frame.to_geodetic(&receiver.position), angle),
        None => radians_to_compass_deg(angle),
    }))
}

fn value(record: &Record, quantity: Quantity) -> Option<f64> {
    record.measured.get(quantity).map(|measured| measured.value)
}

fn sigma(record: &Record, quantity: Quantity) -> Option<f64> {
    record.measured.get(quantity).map(|measured| measured.sigma)
}

/// The receiver's place where it is in local metres of no known origin.
fn local(record: &Record, of: &Recording) -> Option<Vector3<f64>> {
    record.receiver().filter(|_| of.frame().is_none()).map(|receiver| receiver.position)
}

fn local_truth(record: &Record, of: &Recording) -> Option<nalgebra::Vector2<f64>> {
    record.truth.filter(|_| of.frame().is_none())
}

/// Latitude and longitude with nine decimals, a tenth of a millimetre.
fn degrees(frame: &LocalFrame, east: f64, north: f64) -> [String; 2] {
    let place = frame.to_geodetic(&Vector3::new(east, north, 0.0));
    [place.lat_deg, place.lon_deg].map(|degrees| format!("{degrees:.9}"))
}

fn on_earth(record: &Record, of: &Recording) -> Option<[String; 2]> {
    let place = record.receiver()?.position;
    Some(degrees(&of.frame()?, place.x, place.y))
}

fn truth(record: &Record, of: &Recording) -> Option<[String; 2]> {
    let truth = record.truth?;
    Some(degrees(&of.frame()?, truth.x, truth.y))
}

/// Writes recordings in our own format, whatever format they were read from. Angles are counted
/// from true North. Heights are above the ground, or above the frame's origin where a recording has
/// heights above the ellipsoid, as estimators take them. Columns that hold nothing are left out.
/// Returns the number of rows.
///
/// # Errors
///
/// [`RecordingError::Write`] when `out` fails.
pub fn write_recordings(out: impl Write, recordings: &[Recording]) -> Result<u64, RecordingError> {
    let failed = |error: csv::Error| RecordingError::Write { source: error.into() };
    let rows = || recordings.iter().flat_map(|of| of.records().iter().map(move |row| (row, of)));
    let holds = |(_, cell): &&(Column, Cell)| rows().any(|(row, of)| cell(row, of).is_some());
    let columns: Vec<&(Column, Cell)> = CELLS.iter().chain(&LOCAL_TRUTH).filter(holds).collect();
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record(columns.iter().map(|(column, _)| column.name())).map_err(failed)?;
    let mut count = 0;
    for (row, of) in rows() {
        let cells = columns.iter().map(|(_, cell)| cell(row, of).unwrap_or_default());
        csv.write_record(cells).map_err(failed)?;
        count += 1;
    }
    csv.flush().map_err(|source| RecordingError::Write { source })?;
    Ok(count)
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::recording::{Mapping, ReadOptions};

    /// Reads a file of the test data, and its conversion.
    fn converted(name: &str, format: Option<&str>) -> (Recording, Recording) {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
        let mut options = ReadOptions::default();
        if let Some(format) = format {
            options = options.with_format(Mapping::find(format).expect("a format"));
        }
        let mut read = Recording::read_all(&[path], &options).expect("it is read");
        let mut text = Vec::new();
        let count = write_recordings(&mut text, &read).expect("it is written");
        let original = read.pop().expect("one recording");
        assert_eq!(count, original.records().len() as u64);
        let again = Recording::from_reader(&text[..], original.file(), &ReadOptions::default());
        (original, again.unwrap_or_else(|error| panic!("{name}: {error}")))
    }

    #[test]
    fn what_is_written_reads_back_the_same() {
        for (name, format) in [
            ("foxhunt/turns.csv", None),
            ("foxhunt/ranges.csv", None),
            ("foxhunt/differences.csv", None),
            ("aerpaw-afar.csv", None),
            ("otter-telemetry/bearings.csv", None),
            ("uavrt-rotation.csv", Some("uavrt-rotation")),
            ("krakensdr.csv", Some("krakensdr")),
        ] {
            let (original, again) = converted(name, format);
            assert_eq!(again.format(), "foxhunt", "{name}");
            assert_eq!(original.records().len(), again.records().len(), "{name}");
            assert_eq!(original.is_in_utc(), again.is_in_utc(), "{name}");
            assert_eq!(original.is_calibrated(), again.is_calibrated(), "{name}");
            let close = |a: Option<f64>, b: Option<f64>, within: f64| match (a, b) {
                (Some(a), Some(b)) => (a - b).abs() < within,
                (a, b) => a == b,
            };
            for (one, other) in original.records().iter().zip(again.records()) {
                assert_eq!(one.beacon, other.beacon, "{name}");
                assert_eq!(
                    (one.time, one.turn, one.position),
                    (other.time, other.turn, other.position)
                );
                assert_eq!(
                    (one.rss_dbm, one.floor_dbm, one.ceiling_dbm),
                    (other.rss_dbm, other.floor_dbm, other.ceiling_dbm),
                    "{name}"
                );
                assert_eq!(one.receiver_sigma_m, other.receiver_sigma_m, "{name}");
                assert_eq!(one.measured, other.measured, "{name}");
                let turned = |angle: Option<f64>| angle.map(f64::sin);
                assert!(close(turned(one.boresight), turned(other.boresight), 1e-9), "{name}");
                let bearing = |of: &Record| of.bearing.map(|b| b.angle);
                assert!(close(turned(bearing(one)), turned(bearing(other)), 1e-9), "{name}");
                let east = |of: &Record| of.receiver().map(|r| r.position.x);
                let up = |of: &Record| of.receiver().map(|r| r.position.z);
                assert!(close(east(one), east(other), 0.01), "{name}: {one:?} {other:?}");
                assert!(close(up(one), up(other), 1e-9), "{name}: {one:?} {other:?}");
                let north = |of: &Record| of.truth.map(|truth| truth.y);
                assert!(close(north(one), north(other), 0.01), "{name}: {one:?} {other:?}");
            }
        }
    }
}
