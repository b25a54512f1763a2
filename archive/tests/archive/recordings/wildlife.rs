//! Files of receivers for wildlife, and tables of bearings. They are those of
//! `tests/data/wildlife/make.py`, whose columns are the published ones.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::path::PathBuf;

use foxhunt_archive::recording::{ReadOptions, Recording, Rover};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};

/// The beginning of the walk, 2026-06-21 14:03:00 UTC.
const BEGIN: f64 = 1_782_050_580.0;

fn path(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data")).join(name)
}

/// Checks that a recording is of the walk: 40 places, and levels that fall with the distance.
fn is_walk(recording: &Recording, from_s: f64) {
    let frame = recording.frame().expect("places in degrees");
    let begin = Geodetic { lat_deg: 48.2, lon_deg: 16.37, alt_m: frame.origin().alt_m };
    let begin = LocalFrame::new(begin).expect("a place");
    assert_eq!(recording.beacons(), [Some("166.380 393")]);
    assert_eq!(recording.drones(), ["A1"]);
    let mut offsets = Vec::new();
    for record in recording.records() {
        let second = record.time.expect("a time") - BEGIN - from_s;
        let along = 4.0 * second.rem_euclid(100.0);
        let (east, north) = if second < 99.0 { (along, 0.0) } else { (400.0 - along, 150.0) };
        let place = record.receiver().expect("a place").position;
        let local = begin.to_local(&frame.to_geodetic(&place));
        let moved = 4.0 * from_s;
        assert!((local.x - east).hypot(local.y - north) < moved + 2.0, "{second} s: {local}");
        let away = (north - 100.0).hypot(east - 111.0);
        let law = -25.0 * away.log10() + 1.5 * (1.7 * second).sin();
        offsets.push(record.rss_dbm.expect("a level") - law);
    }
    // One offset for all, to the rounding of the receiver.
    let first = offsets[0];
    assert!(
        offsets.iter().all(|offset| abs_diff_eq!(*offset, first, epsilon = 0.3)),
        "{offsets:?}"
    );
}

#[test]
fn detections_of_a_lotek_receiver_are_levels_along_a_path() {
    let rover = Rover::read(path("shapes/walk.kmz")).expect("a track");
    let options = ReadOptions::default().with_rover(rover, 0.0).expect("finite");
    let recording = Recording::read(path("wildlife/srx800.DTA"), &options).expect("joined");
    assert_eq!(recording.records().len(), 40);
    is_walk(&recording, 0.489);
    let said = recording.remarks().iter().find(|remark| remark.code == "converted");
    let said = said.expect("the kind of the file").text.to_string();
    assert!(said.contains("a Lotek receiver") && said.contains("left out: 4"), "{said}");
    let by_name = recording.remarks().iter().any(|remark| remark.code == "columns-by-name");
    assert!(!by_name, "its columns have our names");
    let alone = Recording::read(path("wildlife/srx800.DTA"), &ReadOptions::default());
    let error = alone.expect_err("no places").to_string();
    assert!(error.contains("but no places") && error.contains("srx800.DTA PATH"), "{error}");
}

#[test]
fn a_table_of_an_srx1200_has_places_of_its_own() {
    let recording = Recording::read(path("wildlife/srx1200.csv"), &ReadOptions::default());
    let recording = recording.expect("a table");
    assert_eq!((recording.format(), recording.records().len()), ("lotek-srx1200", 39));
    is_walk(&recording, 0.0);
    assert!(!recording.is_calibrated());
    // The report at the end is two bad rows.
    let remarks: Vec<&str> = recording.remarks().iter().map(|remark| &*remark.code).collect();
    assert!(remarks.contains(&"rows-left-out") && remarks.contains(&"preamble"), "{remarks:?}");
}

#[test]
fn a_group_of_sigloc_is_a_beacon() {
    let recording = Recording::read(path("wildlife/bear.csv"), &ReadOptions::default());
    let recording = recording.expect("bearings");
    assert_eq!(recording.format(), "sigloc");
    assert_eq!(recording.beacons(), [Some("1"), Some("2")]);
    assert_eq!(recording.drones(), ["SB and JS"]);
    for (record, error_deg) in recording.records().iter().zip([1.5, -2.0, 0.5, -1.0, 2.5, -0.5]) {
        let [east, north] = match record.beacon.as_deref() {
            Some("1") => [602_040.0, 5_340_110.0],
            _ => [602_410.0, 5_339_870.0],
        };
        let place = record.receiver().expect("a place").position;
        let to = f64::atan2(north - place.y, east - place.x);
        let off = (record.bearing.as_ref().expect("a bearing").angle - to).sin().asin();
        assert_abs_diff_eq!(off.to_degrees() + error_deg, 0.0, epsilon = 0.06);
    }
    // With its zone the metres are degrees.
    let zone = ReadOptions::default().with_utm_zone("33U".parse().expect("a zone"));
    let recording = Recording::read(path("wildlife/bear.csv"), &zone).expect("bearings");
    assert!(recording.is_in_degrees());
}
