//! Errors in files name the fault, its place and the value.

use std::{error::Error, fs, path::PathBuf};

use foxhunt_archive::recording::{
    Column, FieldProblem, Mapping, ReadOptions, Recording, RecordingError,
};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};

fn fail(text: impl AsRef<[u8]>) -> RecordingError {
    let strict = ReadOptions::default().with_strict(true);
    Recording::from_reader(text.as_ref(), "flight.csv", &strict).expect_err("a mistake")
}

/// Reads `text` in a format, fails, and expects every part in the message.
fn assert_names(text: impl AsRef<[u8]>, parts: &[&str]) {
    let message = fail(text).to_string();
    for part in parts.iter().chain(&["flight.csv"]) {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

const HEADER: &str = "time_s,lat_deg,lon_deg,alt_agl_m,rss_dbm\n0,50,14,10,-60\n";

#[test]
fn a_wrong_cell_is_named_with_file_line_column_and_value() {
    for (row, column, value, problem) in [
        ("0,50,14,10,loud", "rss_dbm", "loud", "not a number"),
        ("0,50,14,10,\"-60,500\"", "rss_dbm", "-60,500", "not a number"),
        ("0,50,14,10,NaN", "rss_dbm", "NaN", "not a finite number"),
        ("0,50,14,10,-inf", "rss_dbm", "-inf", "not a finite number"),
        ("0,50,14,1e999,-60", "alt_agl_m", "1e999", "not a finite number"),
        ("0,50,14,10,-9999", "rss_dbm", "-9999", "between -250 and 100"),
        ("0,99.5,14,10,-60", "lat_deg", "99.5", "swapped"),
        ("0,190.5,14,10,-60", "lat_deg", "190.5", "between -90 and 90"),
        ("0,-99.5,140,10,-60", "lat_deg", "-99.5", "between -90 and 90"),
        ("0,50,-181,10,-60", "lon_deg", "-181", "between -180 and 360"),
        ("0,50,,10,-60", "lon_deg", "", "must not be empty"),
        ("0,,14,10,-60", "lat_deg", "", "must not be empty"),
        (",50,14,10,-60", "time_s", "", "must not be empty"),
        (
            "0,14,50,10,-60",
            "lat_deg, lon_deg",
            "14, 50",
            "origin; latitude and longitude look swapped",
        ),
        ("0,14,49,10,-60", "lat_deg, lon_deg", "14, 49", "look swapped, here or in the first row"),
        ("0,14,40,10,-60", "lat_deg, lon_deg", "14, 40", "at most 200 km make sense"),
        ("0,0,0,10,-60", "lat_deg, lon_deg", "0, 0", "without a fix"),
        ("0,0.5,0,10,-60", "lat_deg, lon_deg", "0.5, 0", "km from the frame's origin"),
    ] {
        let value = format!("{value:?}");
        assert_names(
            format!("{HEADER}\n# a comment\n{row}\n"),
            &["line 5", column, &value, problem],
        );
    }
    for (text, column, value, problem) in [
        ("range_m,rss_db\n0,-60\n", "range_m", "0", "between 0.001"),
        ("east_m,north_m,rss_dbm,turn\n0,0,-60,1.5\n", "turn", "1.5", "whole number"),
        ("east_m,north_m,rss_dbm,turn\n0,0,-60,-1\n", "turn", "-1", "whole number"),
        ("position,boresight_deg_compass,rss_dbm\n65536,0,-60", "position", "65536", "to 65535"),
        ("time_utc,range_m,rss_db\n2021-02-30 00:00:00,1,-60", "time_utc", "2021-02-30", "YYYY"),
        ("heading_deg_compass,antenna_deg,rss_db\n,1,-60", "heading_deg_compass", "", "empty"),
        (
            "east_m,north_m,bearing_deg_compass,bearing_sigma_deg\n0,0,1,0",
            "bearing_sigma_deg",
            "0",
            "between",
        ),
    ] {
        assert_names(text, &["line 2", column, value, problem]);
    }
}

#[test]
fn broken_rows_are_named() {
    assert_names(
        format!("{HEADER}1,50,14\n"),
        &["line 3", "3 fields instead of 5", "lon_deg", "14"],
    );
    let long = format!("{HEADER}1,50,14,10,-60,7\n");
    assert_names(long, &["line 3", "6 fields instead of 5", "column 6", "\"7\""]);
    let mut bytes = HEADER.as_bytes().to_vec();
    bytes.extend(b"1,50,14,10,-6\xff\n");
    assert_names(&bytes, &["line 3", "rss_dbm", "-6\u{ff}", "not a number"]);
    bytes.extend("# \u{e9}\n".as_bytes());
    assert_names(bytes, &["line 3", "rss_dbm", "-6\u{fffd}", "UTF-8"]);
    // An unclosed quote swallows the file; the message does not.
    let swallowed = format!("{HEADER}\"{}", "1,50,14,10,-60\n".repeat(1_000));
    assert!(fail(&swallowed).to_string().len() < 300);
}

#[test]
fn an_unknown_header_is_an_error_that_names_what_it_lacks() {
    assert!(matches!(fail(""), RecordingError::Empty { .. }));
    let message = fail("tag,rssi_db,distance\n0,1,2\n");
    let RecordingError::UnknownFormat { nearest, lacks, known, .. } = &message else {
        panic!("{message}")
    };
    assert_eq!((nearest.as_ref(), &lacks[..]), ("rssi-distance", &["distance_m".to_owned()][..]));
    assert_eq!(known[0], "foxhunt");
    let parts = [
        "line 1",
        "tag, rssi_db, distance",
        "is \"distance\" meant to be \"distance_m\"?",
        "uavrt-rotation",
    ];
    assert_names("tag,rssi_db,distance\n", &parts);
}

#[test]
fn columns_must_make_sense_together() {
    for (header, parts) in [
        ("lat_deg,rss_dbm", ["lat_deg needs", "lon_deg"]),
        ("lat_deg,lon_deg,east_m,north_m,rss_dbm", ["lat_deg and east_m", "exclude"]),
        ("east_m,north_m,rss_dbm,rss_db", ["rss_dbm and rss_db", "exclude"]),
        ("antenna_deg,rss_dbm", ["antenna_deg needs", "heading_deg_compass"]),
        ("time_s,time_utc,east_m,north_m,rss_dbm", ["time_s and time_utc", "exclude"]),
        ("east_m,north_m,rss_dbm,bearing_sigma_deg", ["bearing_sigma_deg needs", "bearing_deg"]),
        ("east_m,north_m,rss_dbm,rss_dbm", ["\"rss_dbm\"", "more than once"]),
    ] {
        assert_names(format!("{header}\n"), &["line 1", parts[0], parts[1]]);
    }
}

#[test]
fn a_named_format_needs_its_columns() {
    let lenth = Mapping::find("lenth1981").expect("shipped");
    let options = ReadOptions::default().with_format(lenth);
    let message = Recording::from_reader(&b"x,y\n1,2\n"[..], "b.csv", &options).expect_err("none");
    let message = message.to_string();
    for part in ["b.csv", "line 1", "\"bearing_deg\"", "lenth1981"] {
        assert!(message.contains(part), "{message}");
    }
    let message = Mapping::find("lenth").expect_err("a slip").to_string();
    assert!(message.contains("\"lenth\"") && message.contains("uri-yagi-station"), "{message}");
}

#[test]
fn when_nothing_is_kept_the_counts_explain_it() {
    let text = "t_s,lat_deg,lon_deg,alt_agl_m,yaw_deg,power_db,quality_db\n\
                0,50,14,3,0,-60,70\n1,50,14,30,0,-60,40\n2,50,14,4,0,-60,40\n3,50,14,40,0,,70\n";
    let expected = [
        "none of 4 rows",
        "2 lack alt_agl_m ≥ 15",
        "1 lack quality_db ≥ 60",
        "1 lack a measurement",
    ];
    assert_names(text, &expected);
    assert_names("range_m,rss_db\n", &["none of 0 rows"]);
    // A filtered row may hold anything elsewhere; the filter's own cell may not.
    let junk = text.replace("0,50,14,3,0,-60,70", "x,999,14,3,0,loud,70");
    assert_names(junk, &expected);
    assert_names(text.replace(",3,0", ",low,0"), &["line 2", "alt_agl_m", "\"low\""]);
}

#[test]
fn a_value_that_the_lookup_does_not_know_is_named() {
    let text = "time,antenna,rssi_dbm,tag_lat_deg,tag_lon_deg\n2021-03-21 16:51:48,6,-97,41,-71\n";
    let options = ReadOptions::default()
        .with_constant(Column::LatDeg, 41.0)
        .with_constant(Column::LonDeg, -71.0);
    let message =
        Recording::from_reader(text.as_bytes(), "d.csv", &options).expect_err("antenna 6");
    let message = message.to_string();
    for part in ["d.csv", "line 2", "antenna", "\"6\"", "mapping"] {
        assert!(message.contains(part), "{message}");
    }
    let known = text.replace(",6,", ",5,");
    let read = Recording::from_reader(known.as_bytes(), "d.csv", &options).expect("the omni");
    assert_eq!(read.records()[0].boresight, None);
    // A constant that cannot be is refused like a cell.
    let options = options.with_constant(Column::LatDeg, "north");
    let message = Recording::from_reader(known.as_bytes(), "d.csv", &options).expect_err("north");
    assert!(message.to_string().contains("lat_deg: \"north\""), "{message}");
}

/// Files in a folder of their own, removed afterwards.
struct Folder(PathBuf);

impl Folder {
    fn with(name: &str, files: &[(&str, &str)]) -> Self {
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
        fs::create_dir_all(&folder).expect("the test's own folder");
        for (file, text) in files {
            fs::write(folder.join(file), text).expect("the test's own file");
        }
        Self(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Nothing depends on whether it is gone.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn files_share_a_frame_or_none() {
    let metres = "east_m,north_m,rss_dbm\n1,2,-60\n";
    let degrees = "lat_deg,lon_deg,rss_dbm\n50,14,-60\n";
    let later = "lat_deg,lon_deg,rss_dbm\n,,-60\n50.001,14,-60\n";
    let ranges = "range_m,rss_db\n1,-60\n";
    let folder = Folder::with(
        "frames",
        &[("m.csv", metres), ("d.csv", degrees), ("l.csv", later), ("r.csv", ranges)],
    );
    let path = |name: &str| folder.0.join(name);
    let default = ReadOptions::default();
    for names in [["m.csv", "d.csv"], ["d.csv", "m.csv"]] {
        let message = Recording::read_all(names.map(path), &default).expect_err("mixed");
        let RecordingError::MixedFrames { file, other } = &message else { panic!("{message}") };
        assert!(file.ends_with("m.csv") && other.ends_with("d.csv"), "{message}");
    }
    let both = Recording::read_all(["r.csv", "d.csv", "r.csv", "l.csv"].map(path), &default);
    let both = both.expect("ranges have no frame, degrees share one");
    assert_eq!(both[3].frame(), both[1].frame());
    let north = both[3].records()[0].receiver().expect("located").position;
    // pymap3d 3.2.0: geodetic2enu(50.001, 14, 0, 50, 14, 0)
    assert!((north - nalgebra::Vector3::new(0.0, 111.229_073_619_5, 0.0)).norm() < 1e-6, "{north}");
    assert_eq!((both[3].dropped()[0].rule.as_str(), both[3].dropped()[0].rows), ("a position", 1));

    let frame = LocalFrame::new(Geodetic { lat_deg: 50.0, lon_deg: 14.001, alt_m: 0.0 });
    let given = default.with_frame(frame.expect("a place"));
    let both = Recording::read_all(["m.csv", "d.csv"].map(path), &given).expect("one frame");
    assert!(both.iter().all(|recording| recording.frame() == given.frame));
    let west = both[1].records()[0].receiver().expect("located").position;
    assert!(west.x < -70.0 && west.x > -73.0, "{west}");
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let message = Recording::read("no/such.csv", &ReadOptions::default()).expect_err("none");
    assert!(message.to_string().contains("no/such.csv") && message.source().is_some(), "{message}");
    let station =
        "time,antenna,rssi_dbm,tag_lat_deg,tag_lon_deg\n2021-03-21 16:51:48,1,-97,41,-71\n";
    let twice = "lat_deg,lon_deg\n41,-71\n41,-71\n";
    let folder = Folder::with("station", &[("d.csv", station), ("station.csv", twice)]);
    let message =
        Recording::read(folder.0.join("d.csv"), &ReadOptions::default()).expect_err("two");
    assert!(matches!(message, RecordingError::NotOneRow { rows: 2, .. }), "{message}");
}

#[test]
fn mappings_scale_offset_and_filter() {
    let mapping = "name = 'my'\ndescription = 'd'\nheader = ['mode']\nkeep = [{ column = 'mode', \
                   equals = 'auto' }, { column = 'h', max = 200 }]\n[columns]\nrss_dbm = { column \
                   = 'half', scale = 2, offset = -10, missing = ['none', 0] }\nrange_m = 'h'\n";
    let mapping = Mapping::parse(mapping, "my.toml").expect("a mapping");
    let options = ReadOptions::default().with_format(mapping);
    let text =
        "half,mode,h\n-20,auto,100\n-20,manual,100\n-20,auto,300\nnone,auto,100\n0.0,auto,100\n";
    let read = Recording::from_reader(text.as_bytes(), "my.csv", &options).expect("one row");
    assert_eq!(read.records().len(), 1);
    assert_eq!(read.records()[0].rss_dbm, Some(-50.0));
    let dropped: Vec<_> = read.dropped().iter().map(|d| (d.rule.as_str(), d.rows)).collect();
    assert_eq!(dropped, [("mode = auto", 1), ("h ≤ 200", 1), ("a measurement", 2)]);
    let wrong = text.replacen("-20", "-200", 1);
    let message =
        Recording::from_reader(wrong.as_bytes(), "my.csv", &options).expect_err("−410 dBm");
    let expected = FieldProblem::OutOfRange { min: -250.0, max: 100.0 };
    assert!(matches!(message, RecordingError::Field { problem, .. } if problem == expected));
}
