//! Autopilots' logs as the path of a receiver. The files are those of
//! `tests/data/flight-logs/make.py`.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::{fs, path::PathBuf};

use foxhunt_archive::recording::{ReadOptions, Recording, RecordingError, Rover};
use foxhunt_wire::geodesy::LocalFrame;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

/// Every log is of the same flight.
const LOGS: [&str; 4] = ["flight.bin", "flight.log", "flight.ulg", "flight.tlog"];

/// The beginning of the flight, 2026-06-21 14:03:00 UTC.
const BEGIN: f64 = 1_782_050_580.0;

fn path(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/flight-logs")).join(name)
}

fn bytes(name: &str) -> Vec<u8> {
    fs::read(path(name)).expect(name)
}

fn rover(name: &str) -> Rover {
    Rover::read(path(name)).expect(name)
}

fn along(name: &str, levels: &str, offset_s: f64) -> Result<Recording, RecordingError> {
    let options = ReadOptions::default().with_rover(rover(name), offset_s).expect("finite");
    Recording::read(path(levels), &options)
}

#[test]
fn each_log_is_the_path_of_the_flight() {
    for name in LOGS {
        assert!(Rover::is_track(&bytes(name)), "{name}");
        let rover = rover(name);
        let origin = rover.begin();
        let frame = LocalFrame::new(origin).expect("a place");
        let off = (origin.lat_deg - 48.2).abs() + (origin.lon_deg - 16.37).abs();
        assert!(off < 1e-5 && (origin.alt_m - 230.0).abs() < 0.02, "{name}: {origin:?}");
        // 4 m/s along lanes of 120 m, 30 m apart.
        for (second, east, north) in
            [(10.0, 40.0, 0.0), (30.0, 120.0, 0.0), (34.0, 120.0, 16.0), (47.5, 80.0, 30.0)]
        {
            let place = rover.place(BEGIN + second).expect("on the path");
            let local = frame.to_local(&place);
            // A degree of the log's own sphere is not that of the ellipsoid to 0.4 %.
            let off = (local.x - east).hypot(local.y - north);
            assert!(off < 1.0, "{name}, {second} s: {local}");
        }
        assert_eq!(rover.place(BEGIN - 5.0), None, "{name}");
        assert_eq!(rover.place(BEGIN + 185.0), None, "{name}");
    }
    for name in ["levels.csv", "make.py"] {
        assert!(!Rover::is_track(&bytes(name)), "{name}");
    }
    let gpx = include_bytes!("../../data/rover.gpx");
    assert!(Rover::is_track(gpx));
}

#[test]
fn levels_without_places_are_joined_by_time() {
    let mut places = Vec::new();
    for name in LOGS {
        let recording = along(name, "levels.csv", 0.0).expect(name);
        assert_eq!(recording.records().len(), 118, "{name}");
        let place = recording.records()[40].receiver().expect("a place").position;
        places.push((place.x, place.y));
        // A clock of its own, and what it showed: 20 s at the path's begin.
        let own = along(name, "levels-own-clock.csv", BEGIN - 20.0).expect(name);
        let other = own.records()[40].receiver().expect("a place").position;
        assert!((other - place).norm() < 0.01, "{name}");
    }
    for (x, y) in &places {
        assert!((x - places[0].0).hypot(y - places[0].1) < 1.0, "{places:?}");
    }
}

#[test]
fn a_table_of_places_is_a_path() {
    // As Airdata writes it: a time since the start beside the date.
    let rows = (0..=180).step_by(5).map(|second| {
        let place = rover("flight.bin").place(BEGIN + f64::from(second)).expect("on the path");
        format!(
            "{},2026-06-21 14:{:02}:{:02},{:.7},{:.7},98\n",
            second * 1000,
            3 + second / 60,
            second % 60,
            place.lat_deg,
            place.lon_deg
        )
    });
    let header = "time(millisecond),datetime(utc),latitude,longitude,battery_percent\n";
    let table = format!("{header}{}", rows.collect::<String>());
    let track = Rover::parse(table.as_bytes(), "airdata.csv").expect("a path");
    let place = track.place(BEGIN + 32.5).expect("on the path");
    let expected = rover("flight.bin").place(BEGIN + 32.5).expect("on the path");
    let off = (place.lat_deg - expected.lat_deg).abs() + (place.lon_deg - expected.lon_deg).abs();
    assert!(off < 1e-5, "{place:?} {expected:?}");
    // The level of a recording that has places of its own is no part of it.
    let own = Recording::from_reader(table.as_bytes(), "airdata.csv", &ReadOptions::default());
    let error = own.expect_err("no levels").to_string();
    for part in ["airdata.csv, line 1", "times and places", "LEVELS.csv airdata.csv"] {
        assert!(error.contains(part), "{error}");
    }
    let levels = Recording::read(path("levels.csv"), &ReadOptions::default());
    let error = levels.expect_err("no places").to_string();
    for part in ["line 1: the columns time, rssi", "but no places", "levels.csv PATH"] {
        assert!(error.contains(part), "{error}");
    }
    for (text, part) in [
        ("seconds,lat,lon\n0,48.2,16.37\n1,48.2,16.37\n", "not in UTC"),
        ("time_utc,x,y\n2026-06-21 14:03:00,0,0\n2026-06-21 14:03:01,1,0\n", "not in degrees"),
        ("noise\n", "noise"),
    ] {
        let error = Rover::parse(text.as_bytes(), "path.csv").expect_err(text).to_string();
        assert!(error.contains("path.csv") && error.contains(part), "{error}");
    }
}

#[test]
fn clocks_that_have_nothing_in_common_are_refused_with_both_times() {
    let error = along("flight.bin", "levels.csv", -7200.0).expect_err("two hours off").to_string();
    for part in [
        "levels.csv: its times, from 2026-06-21 12:03:02.500 to 2026-06-21 12:05:58 UTC",
        "flight.bin, from 2026-06-21 14:03:00 to 2026-06-21 14:06:00",
        "7198 s before",
        "--clock-offset-s",
        "--tz",
    ] {
        assert!(error.contains(part), "{error}");
    }
    let error = along("flight.bin", "levels-own-clock.csv", 0.0).expect_err("no date").to_string();
    for part in ["levels-own-clock.csv", "flight.bin", "time_utc", "--clock-offset-s"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn a_log_without_a_path_says_what_is_missing() {
    let text = String::from_utf8_lossy(&bytes("flight.log")).into_owned();
    let without = |name: &str| {
        let lines = text.lines().filter(|line| !line.starts_with(name));
        lines.collect::<Vec<_>>().join("\n")
    };
    let no_gps = Rover::parse(without("GPS,").as_bytes(), "a.log").expect_err("no time");
    let message = no_gps.to_string();
    assert!(message.contains("a.log: this is an ArduPilot log") && message.contains("UTC"));
    // The GNSS alone will do.
    let no_pos = Rover::parse(without("POS,").as_bytes(), "a.log").expect("a path");
    assert!(no_pos.place(BEGIN + 20.0).is_some());
    let empty = &bytes("flight.ulg")[..500];
    let message = Rover::parse(empty, "a.ulg").expect_err("no place").to_string();
    assert!(message.contains("a.ulg: this is a PX4 log"), "{message}");
}

/// Damaged logs are read as far as they go, or refused: never with a panic or for ever.
#[test]
fn damaged_logs_are_read_or_refused() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(45);
    for name in LOGS {
        let whole = bytes(name);
        for round in 0..60 {
            let mut damaged = whole.clone();
            damaged.truncate(random.random_range(0..=whole.len()));
            for _ in 0..round {
                let at = random.random_range(0..whole.len());
                if let Some(byte) = damaged.get_mut(at) {
                    *byte = random.random();
                }
            }
            if let Ok(rover) = Rover::parse(&damaged, name) {
                assert_abs_diff_eq!(rover.begin().lat_deg, 0.0, epsilon = 90.0);
            }
        }
    }
}

/// The files are those of `tests/data/flight-logs/make_levels.py`: one transmitter at 60 m East and
/// 45 m North, whose levels are in each log.
#[test]
fn levels_in_a_log_are_read_at_its_places() {
    let read = |name: &str, level: Option<&str>| {
        let options = ReadOptions::default();
        let options = level.map_or(options.clone(), |level| options.with_level(level));
        Recording::read(path(name), &options)
    };
    let chosen = [
        ("levels.tlog", Some("RADIO_STATUS.rssi")),
        ("levels.tlog", Some("NAMED_VALUE_FLOAT.vhf_dbm")),
        ("levels.bin", Some("RAD.RSSI")),
        ("levels.ulg", None),
    ];
    for (name, level) in chosen {
        let recording = read(name, level).expect(name);
        let records = recording.records();
        // The log's clock in UTC is good to a message, and the last second may have no place.
        assert!(records.len() >= 149, "{name}: {}", records.len());
        // −40 − 25 log₁₀ of the distance, at 30 m of height over the first place.
        let first = records[0].receiver().expect("a place").position;
        let off = |(east, north): (f64, f64)| (first.x - east).hypot(first.y - north);
        assert!(off((0.0, 0.0)) < 1.0, "{name}: {first}");
        let strongest =
            records.iter().max_by(|a, b| a.rss_dbm.partial_cmp(&b.rss_dbm).expect("numbers"));
        let place = strongest.and_then(|record| record.receiver()).expect("a place").position;
        assert!((place.x - 60.0).hypot(place.y - 45.0) < 40.0, "{name} {level:?}: {place}");
        let level = records[0].rss_dbm.expect("a level");
        let law = -40.0 - 25.0 * 80.8_f64.log10();
        assert!(abs_diff_eq!(level, law, epsilon = 5.0), "{name}: {level} {law}");
        assert!(recording.remarks().iter().any(|remark| remark.text.contains("levels")), "{name}");
    }
    for (name, level, part) in [
        ("levels.tlog", None, "RADIO_STATUS.rssi (150)"),
        ("levels.bin", None, "RSSI.RXRSSI (150)"),
        ("levels.bin", Some("RADIO_STATUS.rssi"), "without levels \"RADIO_STATUS.rssi\""),
        ("levels.ulg", Some("rssi"), "--level NAME"),
    ] {
        let error = read(name, level).expect_err(name).to_string();
        assert!(error.contains(part), "{error}");
    }
    // A log without levels is a path.
    assert!(matches!(read("flight.bin", None), Err(RecordingError::NotATable { .. })));
}
