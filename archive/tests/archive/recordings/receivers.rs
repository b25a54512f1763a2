//! Detections of ATS receivers, packets of TinyGS and console logs of XCTU. The files are those of
//! `tests/data/receivers/make.py`, by the forms that the readers name.

use std::path::PathBuf;

use approx::assert_abs_diff_eq;
use foxhunt_archive::recording::{ReadOptions, Recording, RecordingError, Rover};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};

/// The beginning of the walk, 2026-06-21 14:03:00 UTC.
const BEGIN: f64 = 1_782_050_580.0;

fn path(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/receivers")).join(name)
}

fn read(name: &str, options: &ReadOptions) -> Result<Recording, RecordingError> {
    Recording::read(path(name), options)
}

/// Texts of the remarks with a code.
fn said(recording: &Recording, code: &str) -> String {
    let remarks = recording.remarks().iter().filter(|remark| remark.code == code);
    remarks.map(|remark| remark.text.to_string()).collect()
}

/// Checks that the places of a recording are those of the walk, 40 of them.
fn is_walk(recording: &Recording) {
    let frame = recording.frame().expect("places in degrees");
    let begin = Geodetic { lat_deg: 48.2, lon_deg: 16.37, alt_m: frame.origin().alt_m };
    let begin = LocalFrame::new(begin).expect("a place");
    assert_eq!(recording.records().len(), 40);
    for record in recording.records() {
        let second = (record.time.expect("a time") - BEGIN).floor();
        let along = 4.0 * second.rem_euclid(100.0);
        let (east, north) = if second < 100.0 { (along, 0.0) } else { (400.0 - along, 150.0) };
        let place = record.receiver().expect("a place").position;
        let local = begin.to_local(&frame.to_geodetic(&place));
        assert_abs_diff_eq!(local.x, east, epsilon = 2.0);
        assert_abs_diff_eq!(local.y, north, epsilon = 2.0);
    }
}

#[test]
fn detections_of_an_ats_receiver_in_the_air_have_places() {
    for name in ["ats-aerial.csv", "ats-aerial-utm.csv"] {
        let recording = read(name, &ReadOptions::default()).expect(name);
        assert_eq!((recording.format(), recording.beacons()), ("ats", vec![Some("164.305 12")]));
        assert!(recording.is_in_utc() && !recording.is_calibrated());
        is_walk(&recording);
    }
    let recording = read("ats-aerial.csv", &ReadOptions::default()).expect("detections");
    let kind = said(&recording, "converted");
    assert!(kind.contains("Advanced Telemetry Systems") && kind.contains("out: 40"), "{kind}");
    let left_out = said(&recording, "rows-left-out");
    assert!(left_out.contains("line 14: 7 cells, where a detection has 9"), "{left_out}");
    // The receiver's clock may show another zone.
    let local = ReadOptions::default().with_time_zone("+02:00".parse().expect("an offset"));
    let local = read("ats-aerial.csv", &local).expect("detections");
    assert_abs_diff_eq!(local.records()[0].time.expect("a time"), BEGIN - 7200.0);
}

#[test]
fn receivers_that_stand_have_their_places_beside_them() {
    let recording = read("towers/pond.csv", &ReadOptions::default()).expect("detections");
    assert_eq!((recording.drones(), recording.beacons()), (vec!["pond"], vec![Some("4305 30")]));
    let place = recording.first_place().expect("of stations.csv");
    assert_abs_diff_eq!(place.lat_deg, 48.200_36, epsilon = 1e-6);
    assert_eq!(recording.records().len(), 12);
    // Without them they have levels alone, as beside a path.
    let alone = read("ats-minutes.csv", &ReadOptions::default()).expect("detections");
    assert!(alone.records().iter().all(|record| record.receiver().is_none()));
}

#[test]
fn packets_of_tinygs_are_levels_at_its_stations() {
    for (name, format, drone) in
        [("tinygs.jsonl", "tinygs", "48.1955 16.3579"), ("tinygs.txt", "tinygs-mqtt", "roof")]
    {
        let recording = read(name, &ReadOptions::default()).expect(name);
        assert_eq!((recording.format(), recording.beacons()), (format, vec![Some("Fox")]));
        assert_eq!((recording.drones().len(), recording.drones()[0]), (7, drone));
        assert_eq!(recording.records().len(), 42, "{name}");
        let first = &recording.records()[0];
        assert_abs_diff_eq!(first.time.expect("a time"), BEGIN + 0.12, epsilon = 1e-5);
        assert!(recording.records().iter().all(|record| record.rss_dbm < Some(-80.0)), "{name}");
    }
}

#[test]
fn levels_of_xctus_console_lie_on_a_path() {
    let rover = Rover::read(path("../shapes/walk.kmz")).expect("a track");
    let on_path = ReadOptions::default().with_rover(rover, 0.0).expect("finite");
    let recording = read("xctu.log", &on_path).expect("levels");
    assert_eq!(recording.beacons(), [Some("0013A20040401122")]);
    is_walk(&recording);
    assert!(recording.is_calibrated());
    let left_out = said(&recording, "rows-left-out");
    assert!(left_out.contains("line 8: the frame's checksum is wrong"), "{left_out}");
    let error = read("xctu.log", &ReadOptions::default()).expect_err("no places").to_string();
    let parts = ["a log of XCTU's console", "but no places", "xctu.log PATH"];
    assert!(parts.iter().all(|part| error.contains(part)), "{error}");
}
