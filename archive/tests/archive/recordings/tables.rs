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

#[test]
fn receivers_that_are_all_at_one_place_are_doubted() {
    let table = |places: [(f64, f64); 3]| {
        let row = |(number, (east, north)): (usize, (f64, f64))| {
            format!(
                "node{number},{east},{north},-6{number}
"
            )
        };
        let rows: String = places.into_iter().enumerate().map(row).collect();
        plain(format!(
            "drone,east_m,north_m,rss_dbm
{rows}"
        ))
    };
    let same = table([(10.0, 20.0), (10.0, 20.0), (10.2, 20.0)]);
    assert_eq!(codes(&same), ["receivers-at-one-place"]);
    assert!(same.remarks()[0].text.contains("walk.csv: all 3 receivers"), "{:?}", same.remarks());
    assert_eq!(codes(&table([(10.0, 20.0), (10.0, 20.0), (40.0, 20.0)])), [""; 0]);
    let one = "drone,east_m,north_m,rss_dbm
node,0,0,-60
node,0,0,-61
";
    assert_eq!(codes(&plain(one)), [""; 0]);
}

#[test]
fn levels_without_their_sign_are_doubted_and_mended() {
    const POSITIVE: &str = include_str!("../../data/tables/positive-rssi.csv");
    let recording = plain(POSITIVE);
    let [remark] = recording.remarks() else { panic!("{:?}", recording.remarks()) };
    assert_eq!(remark.code, "positive-levels");
    for part in ["walk.csv", "--negate-levels", "scale = -1", "dBm"] {
        assert!(remark.text.contains(part), "{remark}");
    }
    let mended = read(POSITIVE, &ReadOptions::default().with_negated_levels(true)).expect("levels");
    assert_eq!(codes(&mended), [""; 0]);
    for (before, after) in recording.records().iter().zip(mended.records()) {
        assert_eq!(before.rss_dbm.map(|level| -level), after.rss_dbm);
    }
    let with = |header: &str, levels: [&str; 3]| {
        let rows = levels.map(|level| format!("{level},5\n")).concat();
        let recording = plain(format!("{header},range_m\n{rows}"));
        !recording.remarks().is_empty()
    };
    for (header, levels, is_doubted) in [
        ("rss_dbm", ["71", "80", "21"], true),
        ("rss_dbm", ["100", "30.5", "44"], true),
        ("rss_dbm", ["71", "", "90"], true),
        // Near a strong transmitter, and about a reference that nobody knows.
        ("rss_dbm", ["71", "80", "19"], false),
        ("rss_dbm", ["0", "10", "5"], false),
        ("rss_db", ["71", "80", "60"], false),
        ("rss_dbm", ["-71", "-80", "-60"], false),
    ] {
        assert_eq!(with(header, levels), is_doubted, "{header}: {levels:?}");
    }
    // A floor is mended as the levels are, but not one that the command line states.
    let text = "rss_dbm,floor_dbm,range_m\n71,90,5\n";
    let mended = read(text, &ReadOptions::default().with_negated_levels(true)).expect("a row");
    assert_eq!(mended.records()[0].floor_dbm, Some(-90.0));
}

#[test]
fn a_mapping_adds_columns() {
    const ATTENUATED: &str = include_str!("../../data/tables/attenuator.csv");
    let mapped = |level: &str| {
        let text = format!(
            "name = 'att'\ndescription = 'd'\n[columns]\ntime_s = 'time_s'\neast_m = 'east_m'\n\
             north_m = 'north_m'\n{level}\n"
        );
        let mapping = Mapping::parse(&text, "att.toml").expect(level);
        let recording = read(ATTENUATED, &ReadOptions::default().with_format(mapping));
        recording.map(|of| of.records().iter().filter_map(|r| r.rss_dbm).collect::<Vec<_>>())
    };
    let raw = mapped("rss_db = 's_meter_db'").expect("levels");
    let cell = |line: &str, index| line.split(',').nth(index).and_then(|c| c.parse::<f64>().ok());
    let steps: Vec<f64> = ATTENUATED.lines().skip(1).filter_map(|line| cell(line, 4)).collect();
    assert!(steps.iter().any(|step| *step > 0.0) && steps.len() == raw.len());
    let sum = |sign: f64| -> Vec<f64> {
        raw.iter().zip(&steps).map(|(level, step)| level + sign * step).collect()
    };
    for (level, sign) in [
        ("rss_db = 's_meter_db + attenuator_db'", 1.0),
        ("rss_db = ['s_meter_db', 'attenuator_db']", 1.0),
        ("rss_db = ['s_meter_db', '+attenuator_db']", 1.0),
        ("rss_db = { columns = ['s_meter_db', 'attenuator_db'] }", 1.0),
        ("rss_db = 's_meter_db'\nattenuation_db = 'attenuator_db'", 1.0),
        ("rss_db = 's_meter_db - attenuator_db'", -1.0),
        ("rss_db = ['s_meter_db', '-attenuator_db']", -1.0),
        ("rss_db = 's_meter_db'\ngain_db = 'attenuator_db'", -1.0),
        ("rss_db = 's_meter_db'\nattenuation_db = { column = 'attenuator_db', scale = -1 }", -1.0),
    ] {
        assert_eq!(mapped(level).expect(level), sum(sign), "{level}");
    }
    let error = mapped("rss_db = 's_meter_db + attenuator'").expect_err("a slip").to_string();
    for part in ["walk.csv", "\"attenuator\"", "is \"attenuator_db\" meant"] {
        assert!(error.contains(part), "{error}");
    }
    // A column whose name holds a sign is one column.
    let text = "s + n,d\n-60,5\n";
    let mapping = "name = 'n'\ndescription = 'd'\n[columns]\nrss_dbm = 's + n'\nrange_m = 'd'\n";
    let mapping = Mapping::parse(mapping, "n.toml").expect("a mapping");
    let named = read(text, &ReadOptions::default().with_format(mapping)).expect("a row");
    assert_eq!(named.records()[0].rss_dbm, Some(-60.0));
}

#[test]
fn attenuation_and_gain_of_our_own_table_are_taken_off() {
    let text = "range_m,rss_dbm,attenuation_db,gain_db,floor_dbm\n5,-60,20,3,-100\n9,-60,0,0,\n";
    let recording = plain(text);
    let levels: Vec<_> = recording.records().iter().map(|r| (r.rss_dbm, r.floor_dbm)).collect();
    assert_eq!(levels, [(Some(-43.0), Some(-83.0)), (Some(-60.0), None)]);
    // A level whose attenuation is not known is none.
    let recording = plain("range_m,rss_dbm,attenuation_db\n5,-60,20\n9,-60,\n7,,\n6,-61,0\n");
    assert_eq!(codes(&recording), ["rows-left-out"]);
    assert!(recording.remarks()[0].text.contains("line 3, attenuation_db"), "{recording:?}");
    // One of another name is not used in silence.
    let recording = plain("range_m,rss_dbm,attenuator_db\n5,-60,20\n");
    assert_eq!(codes(&recording), ["column-not-used"]);
    assert!(recording.remarks()[0].text.contains("\"attenuator_db\""), "{recording:?}");
    let error = read("range_m,range_sigma_m,gain_db\n5,1,2\n", &ReadOptions::default());
    assert!(error.expect_err("no level").to_string().contains("gain_db needs rss_dbm"));
}

#[test]
fn the_most_natural_tables_are_read_by_their_names() {
    let rows = |header: &str, rows: [&str; 2]| plain(format!("{header}\n{}\n", rows.join("\n")));
    let levels = ["0,50,14,-60", "5,50.001,14,-63"];
    let expected = rows("time_s,lat_deg,lon_deg,rss_db", levels);
    for header in [
        "time,lat,lon,rssi",
        "Time,Latitude,Longitude,RSSI",
        "timestamp,lat,lng,level",
        "# t,lat,long,signal",
        "time [s],Lat (deg),Lon (deg),Signal strength",
    ] {
        let read = rows(header, levels);
        assert_eq!(read.records(), expected.records(), "{header}");
        assert_eq!((read.format(), read.is_calibrated()), ("plain", false), "{header}");
        assert_eq!(codes(&read), ["columns-by-name"], "{header}");
        assert!(read.remarks()[0].text.contains("as lat_deg"), "{:?}", read.remarks());
    }
    let calibrated = rows("time,lat,lon,RSSI [dBm]", levels);
    assert!(calibrated.is_calibrated() && calibrated.records() == expected.records());
    let dated = rows(
        "time,lat,lon,rssi",
        ["2026-07-30T10:00:00Z,50,14,-60", "2026-07-30T10:00:05Z,50.001,14,-63"],
    );
    let milliseconds =
        rows("time,lat,lon,rssi", ["1785405600000,50,14,-60", "1785405605000,50.001,14,-63"]);
    assert!(dated.is_in_utc() && dated.records() == milliseconds.records());
    let bearings = ["50,14,10", "50.001,14,20"];
    let expected = rows("lat_deg,lon_deg,bearing_deg_compass", bearings);
    for header in ["lat,lon,bearing", "Latitude;Longitude;Azimuth", "lat,lon,bearing_deg"] {
        let separated =
            bearings.map(|row| row.replace(',', if header.contains(';') { ";" } else { "," }));
        let read = rows(header, [&separated[0], &separated[1]]);
        assert_eq!(read.records(), expected.records(), "{header}");
    }
    for text in ["lat,lon,heading\n50,14,10\n", "lat,lon,direction\n50,14,10\n"] {
        let error = read(text, &ReadOptions::default()).expect_err(text).to_string();
        assert!(error.contains("may be the bearing"), "{error}");
    }
    // RSSI without its sign, about a reference that the name states.
    let positive = rows("time,lat,lon,rssi", ["0,50,14,60", "5,50.001,14,63"]);
    assert_eq!(codes(&positive), ["columns-by-name", "positive-levels"]);
}
