//! JSON: lines, lists, messages of networks. The files are those of `tests/data/json/make.py`.

use std::{collections::BTreeSet, path::Path};

use foxhunt_archive::recording::{ReadOptions, Recording, RecordingError};
use foxhunt_wire::geodesy::Geodetic;

fn file(name: &str) -> Recording {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/json")).join(name);
    Recording::read(path, &ReadOptions::default()).expect(name)
}

fn read(text: &str) -> Result<Recording, RecordingError> {
    Recording::from_reader(text.as_bytes(), "walk.jsonl", &ReadOptions::default())
}

/// The transmitter of the files, in degrees.
const TRUTH: Geodetic = Geodetic { lat_deg: 48.198_741, lon_deg: 16.372_833, alt_m: 0.0 };

#[test]
fn each_gateway_of_an_uplink_is_a_receiver() {
    let mut levels = BTreeSet::new();
    for (name, beacon, gateway) in [
        ("chirpstack.jsonl", "0101010101010101", "016c001ff10a2350"),
        ("chirpstack3.jsonl", "02aaaa010000318d", "016c001ff10a2350"),
        ("ttn.jsonl", "fox", "gateway-0"),
    ] {
        let recording = file(name);
        assert_eq!(Some(recording.format()), name.split('.').next());
        assert_eq!(recording.beacons(), [Some(beacon)]);
        assert_eq!((recording.records().len(), recording.drones().len()), (96, 8), "{name}");
        assert_eq!(recording.drones()[0], gateway);
        assert!(recording.is_in_utc() && recording.is_calibrated(), "{name}");
        assert_eq!(recording.remarks(), [], "{name}");
        let lines = recording.records().iter().map(|record| record.line);
        assert_eq!(lines.collect::<BTreeSet<u64>>(), (1..=12).collect(), "{name}");
        let all = recording.records().iter().filter_map(|r| r.rss_dbm).map(|l| l.to_string());
        levels.insert(all.collect::<Vec<String>>());
    }
    assert_eq!(levels.len(), 1, "the uplinks are the same");
}

#[test]
fn bearings_of_other_programs_meet_at_the_transmitter() {
    for (name, records, most_deg) in [("chasemapper.log", 4, 8.0), ("krakensdr.json", 24, 16.0)] {
        let recording = file(name);
        assert_eq!(recording.records().len(), records, "{name}");
        let truth = recording.frame().expect("degrees").to_local(&TRUTH);
        for record in recording.records() {
            let way = truth - record.receiver().expect("a place").position;
            let bearing = record.bearing.expect("a bearing").angle;
            let off = foxhunt_core::angle::distance(bearing, way.y.atan2(way.x)).to_degrees();
            assert!(off.abs() < most_deg, "{name}, line {}: {off}°", record.line);
        }
    }
}

#[test]
fn nodes_that_move_and_rooms_with_nodes_are_places() {
    let recording = file("meshtastic.jsonl");
    assert_eq!(recording.records().len(), 80);
    assert_eq!(recording.beacons(), [Some("!7efeee00")]);
    assert!(recording.records().iter().all(|r| r.rss_dbm.is_some_and(|level| level < -50.0)));
    let recording = file("espresense.txt");
    assert_eq!((recording.records().len(), recording.drones().len()), (50, 5));
    let kitchen = recording.records().iter().find(|record| &*record.drone == "kitchen");
    let place = kitchen.expect("a room").receiver().expect("a place").position;
    assert!((place - nalgebra::Vector3::new(8.0, 0.0, 2.0)).norm() < 1e-12, "{place}");
}

#[test]
fn common_names_are_found_in_nested_keys() {
    let lines = "{\"time\":\"2026-06-21T14:03:00Z\",\"gps\":{\"lat\":50.5,\"lon\":14.2},\
                 \"radio\":{\"rssi\":-60}}\n\
                 {\"radio\":{\"rssi\":-61},\"time\":\"2026-06-21T14:03:05Z\",\
                 \"gps\":{\"lat\":50.5001,\"lon\":14.2}}\n";
    let list = format!("[{}]", lines.trim().replace('\n', ",\n"));
    for text in [lines, &list] {
        let recording = read(text).expect("a table");
        let levels: Vec<_> = recording.records().iter().map(|r| r.rss_dbm).collect();
        assert_eq!(levels, [Some(-60.0), Some(-61.0)]);
        let remark = &recording.remarks()[0];
        assert!(remark.text.contains("gps.lat as lat_deg"), "{remark}");
        let remark = "radio.rssi as rss_db";
        assert!(recording.remarks()[0].text.contains(remark));
    }
    // Two places: nothing tells which is the receiver's.
    let error = read("{\"tx\":{\"lat\":1,\"lon\":2},\"rx\":{\"lat\":1,\"lon\":2},\"rssi\":-1}\n");
    assert!(matches!(error, Err(RecordingError::UnknownFormat { .. })), "{error:?}");
}

#[test]
fn a_line_that_is_no_json_is_one_bad_row() {
    let line = |second: u32| format!("{{\"t\":{second},\"x\":{second},\"y\":0,\"rssi\":-60}}\n");
    let broken = ["{\"t\":1,\n".to_owned(), line(2), "noise\n".to_owned()].concat();
    let text = [line(0), broken, line(3), line(4)].concat();
    let recording = read(&text).expect("four rows");
    assert_eq!(recording.records().iter().map(|r| r.line).collect::<Vec<_>>(), [1, 3, 5, 6]);
    let remark = recording.remarks().iter().find(|remark| remark.code == "rows-left-out");
    let text_of = &remark.expect("two rows").text;
    for part in ["2 of 6 rows", "line 2", "line 4", "JSON"] {
        assert!(text_of.contains(part), "{text_of}");
    }
    let strict = ReadOptions::default().with_strict(true);
    let error = Recording::from_reader(text.as_bytes(), "walk.jsonl", &strict);
    assert!(error.expect_err("refused").to_string().contains("walk.jsonl, line 2"));
    let wrong = text.replacen("-60", "\"loud\"", 1);
    let remarks = read(&wrong).expect("two rows").remarks().to_vec();
    assert!(remarks.iter().any(|remark| remark.text.contains("line 1, rssi")), "{remarks:?}");
}
