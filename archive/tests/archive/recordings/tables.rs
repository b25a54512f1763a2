//! Tables as people have them: what comes before the header, commas as decimal points, encodings.

use foxhunt_archive::recording::{Mapping, ReadOptions, Recording, RecordingError};

const WIGLE: &str = include_str!("../../data/tables/wigle.csv");
const DECIMAL_COMMA: &str = include_str!("../../data/tables/decimal-comma.csv");

fn wigle() -> ReadOptions {
    let mapping = include_str!("../../data/tables/wigle.toml");
    ReadOptions::default().with_format(Mapping::parse(mapping, "wigle.toml").expect("a mapping"))
}

fn read(bytes: impl AsRef<[u8]>, options: &ReadOptions) -> Result<Recording, RecordingError> {
    Recording::from_reader(bytes.as_ref(), "walk.csv", options)
}

fn plain(bytes: impl AsRef<[u8]>) -> Recording {
    read(bytes, &ReadOptions::default()).expect("a table")
}

fn codes(recording: &Recording) -> Vec<&str> {
    recording.remarks().iter().map(|remark| &*remark.code).collect()
}

const WALK: &str = "time_s,lat_deg,lon_deg,rss_db\n0,50.5,14.25,1.5\n1,50.5001,14.2501,-2\n";

#[test]
fn a_preamble_is_skipped_and_two_fixes_that_jump_are_named() {
    let recording = read(WIGLE, &wigle()).expect("a table behind a line");
    assert_eq!(codes(&recording), ["position-jumps", "preamble"]);
    let [jumps, preamble] = recording.remarks() else { panic!("two") };
    assert!(jumps.text.contains("2 of 100 rows") && jumps.text.contains("walk.csv"), "{jumps}");
    assert!(preamble.text.contains("line 2"), "{preamble}");
    assert_eq!(recording.records().len(), 98);
    let farthest = recording
        .records()
        .iter()
        .map(|record| record.receiver.expect("located").position.xy().norm());
    assert!(farthest.fold(0.0, f64::max) < 600.0, "nobody is 1.7 km away");
}

#[test]
fn the_header_is_found_behind_lines_of_text() {
    for (before, skipped) in [
        ("Receiver log of 2026-07-30\n", true),
        ("Model;Firmware;Serial\nR2;1.7;00912\n\n", true),
        ("name,\"a, b\",c,d\nx,1,2,3\n# comment\nstarted,12:00\n", true),
        ("# time, place and level of a walk\n\n", false),
        ("", false),
    ] {
        let recording = plain(format!("{before}{WALK}"));
        assert_eq!(recording.records().len(), 2, "{before}");
        assert_eq!(codes(&recording), if skipped { vec!["preamble"] } else { vec![] }, "{before}");
        let line = before.lines().count() as u64 + 2;
        assert_eq!(recording.records()[0].line, line, "{before}");
    }
    // Behind a sign of a comment.
    for sign in ["#", "# ", "#  "] {
        let recording = plain(format!("# a walk\n{sign}{WALK}"));
        assert_eq!((recording.records().len(), codes(&recording)), (2, vec![]));
        assert_eq!(recording.records()[0].line, 3);
    }
    // A comment that shows the header is none.
    assert_eq!(plain(format!("# time_s,lat_deg,lon_deg,rss_dbm\n{WALK}")).records().len(), 2);
    // Too far down is no header.
    assert!(read("a line\n".repeat(25) + WALK, &ReadOptions::default()).is_err());
}

#[test]
fn commas_are_decimal_points_where_something_else_separates_cells() {
    let recording = plain(DECIMAL_COMMA);
    assert_eq!(codes(&recording), [""; 0]);
    let first = &recording.records()[0];
    assert_eq!(first.rss_dbm, Some(19.3));
    let origin = recording.frame().expect("in degrees").origin();
    assert!((origin.lat_deg - 50.075_230_3).abs() < 1e-12, "{origin:?}");
    assert_eq!(plain(DECIMAL_COMMA.replace(';', "\t")).records(), recording.records());
    let points = DECIMAL_COMMA.replace(',', ".");
    assert_eq!(plain(points.replace(';', ",")).records(), recording.records());
    assert_eq!(plain(points).records(), recording.records());
    // A comma beside points separates thousands; between cells it is quoted.
    let thousands = "time_s;lat_deg;lon_deg;alt_m;rss_db\n0;50.5;14.2;1,234;7\n";
    for text in [thousands, "time_s,east_m,north_m,rss_db\n0,0,0,\"1,5\"\n"] {
        let error = read(text, &ReadOptions::default()).expect_err(text).to_string();
        assert!(error.contains("line 2") && error.contains("not a number"), "{error}");
    }
}

#[test]
fn encodings_and_quotes_change_nothing() {
    let expected = plain(WALK);
    let quoted: String = WALK
        .lines()
        .map(|line| line.split(',').map(|cell| format!("\"{cell}\"")).collect::<Vec<_>>().join(","))
        .map(|line| line + "\r\n")
        .collect();
    let utf_16 = |big: bool| {
        let unit = |unit: u16| if big { unit.to_be_bytes() } else { unit.to_le_bytes() };
        let units = std::iter::once(0xfeff).chain(WALK.encode_utf16());
        units.flat_map(unit).collect::<Vec<u8>>()
    };
    let marked = format!("\u{feff}{WALK}").into_bytes();
    let trailing = WALK.replace('\n', ",\n").into_bytes();
    for bytes in [quoted.into_bytes(), utf_16(true), utf_16(false), marked, trailing] {
        let recording = plain(&bytes);
        assert_eq!(recording.records(), expected.records());
        assert_eq!(recording.remarks(), []);
    }
    let behind = format!("\u{feff}a walk\n{WALK}");
    assert_eq!(plain(behind).records().len(), 2);
}
