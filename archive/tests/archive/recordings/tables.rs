//! Tables as people have them: what comes before the header, commas as decimal points, encodings.

use approx::assert_abs_diff_eq;
use foxhunt_archive::recording::{Mapping, ReadOptions, Recording, RecordingError, utc_seconds};

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
        .map(|record| record.receiver().expect("located").position.xy().norm());
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
    assert_abs_diff_eq!(origin.lat_deg, 50.075_230_3, epsilon = 1e-12);
    assert_eq!(plain(DECIMAL_COMMA.replace(';', "\t")).records(), recording.records());
    let points = DECIMAL_COMMA.replace(',', ".");
    assert_eq!(plain(points.replace(';', ",")).records(), recording.records());
    assert_eq!(plain(points).records(), recording.records());
    // Between commas it stands in quotes.
    let quoted = plain("time_s,east_m,north_m,rss_db\n0,0,0,\"1,5\"\n");
    assert_eq!(quoted.records()[0].rss_dbm, Some(1.5));
    // A comma beside points separates thousands, and in quotes three digits may be.
    let thousands = "time_s;lat_deg;lon_deg;alt_m;rss_db\n0;50.5;14.2;1,234;7\n";
    for text in [thousands, "time_s,east_m,north_m,rss_db\n0,0,0,\"1,500\"\n"] {
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

fn problem(bytes: impl AsRef<[u8]>) -> String {
    read(bytes, &ReadOptions::default()).expect_err("it cannot be read").to_string()
}

fn named(columns: &str) -> ReadOptions {
    ReadOptions::default().with_columns(columns.split(','))
}

#[test]
fn a_table_without_a_header_is_read_by_the_names_that_are_given() {
    let header = "lat,lon,bearing\n";
    let rows = "50.0755,14.4378,45\n50.0755,14.4452,315\n50.08,14.44,180\n";
    let expected = plain(format!("{header}{rows}"));
    let tabs = rows.replace(',', "\t");
    let spaces = rows.replace(',', " ");
    let wide = rows.replace(',', "   ");
    let commas = rows.replace(',', ";").replace('.', ",");
    let padded = rows.replace(',', ", ");
    for text in [rows, &tabs, &spaces, &wide, &commas, &padded] {
        let recording = read(text, &named("lat,lon,bearing")).expect(text);
        let bearings = |of: &Recording| of.records().iter().map(|r| r.bearing).collect::<Vec<_>>();
        assert_eq!(bearings(&recording), bearings(&expected), "{text}");
        assert_eq!(recording.records()[0].line, 1);
        assert_eq!(codes(&recording), ["columns-by-name"]);
    }
    // A column that is not to be read, names of our own, and the names of a mapping's columns.
    let skipped = rows.replace(',', ",x,");
    let recording = read(skipped, &named("lat_deg,-,lon_deg,-,bearing_deg_compass")).expect("rows");
    assert_eq!((recording.records().len(), recording.ignored_columns()), (3, &[][..]));
    let mapping = "name = 'n'\ndescription = 'd'\n[columns]\nrss_dbm = 'a'\nrange_m = 'b'\n";
    let mapping = Mapping::parse(mapping, "n.toml").expect("a mapping");
    let recording = read("-60,5\n", &named("a,b").with_format(mapping)).expect("a row");
    assert_eq!(recording.records()[0].rss_dbm, Some(-60.0));
}

#[test]
fn a_table_without_a_header_says_which_command_reads_it() {
    for (rows, row, command) in [
        (
            "50.0755,14.4378,45\n50.0755,14.4452,315\n",
            "50.0755, 14.4378, 45",
            "foxhunt locate walk.csv --columns lat,lon,bearing",
        ),
        (
            "21.06.2026 14:03;50,0755;14,4378;-71\n",
            "21.06.2026 14:03, 50,0755, 14,4378, -71",
            "--columns time,lat,lon,rssi",
        ),
        ("\n# typed\n0,100,315\n", "line 3", "--columns x,y,bearing"),
    ] {
        let error = problem(rows);
        for part in ["walk.csv, line", "no header", row, command] {
            assert!(error.contains(part), "{part}: {error}");
        }
        // The command works.
        let names = command.rsplit(' ').next().expect("names");
        assert!(read(rows, &named(names)).is_ok(), "{command}");
    }
    let error = Recording::from_reader(&b"1,2,3\n"[..], "standard input", &ReadOptions::default());
    let error = error.expect_err("no header").to_string();
    assert!(error.contains("locate - --columns"), "{error}");
    // Too many columns to be named in a command.
    let error = problem(format!("{}\n", ["1"; 40].join(",")));
    assert!(error.contains("names = [...]") && !error.contains("--columns"), "{error}");
    // KrakenSDR's log is known by its row.
    let kraken = include_str!("../../data/krakensdr.csv");
    assert_eq!(plain(kraken).format(), "krakensdr");
    // More or fewer names than cells.
    for names in ["rss_dbm,range_m", "lat,lon,bearing,sigma"] {
        let error = read("50.1,14.2,45\n50.2,14.3,46\n", &named(names)).expect_err(names);
        assert!(error.to_string().contains("3 fields instead of"), "{error}");
    }
}

#[test]
fn what_is_no_table_is_named_without_its_bytes() {
    for (bytes, what, command) in [
        (&b"PK\x03\x04\x14\0\x06\0"[..], "spreadsheet", "CSV"),
        (b"SQLite format 3\0\x10\0", "SQLite", "foxhunt convert walk.csv"),
        (b"RIFF\x24\xff\xff\x7fWAVE", "samples", "foxhunt pulses walk.csv"),
        (b"ULog\x01\x12\x35\x01\x7f", "PX4 log", "foxhunt locate walk.csv LEVELS"),
        (b"\xa3\x95\x80\x80", "ArduPilot log", "foxhunt locate walk.csv LEVELS"),
        (b"<?xml version=\"1.0\"?><gpx/>", "a GPX track", "foxhunt locate walk.csv LEVELS"),
        (b"<?xml version=\"1.0\"?><kml/>", "a KML file", "foxhunt locate walk.csv LEVELS"),
        (b"<?xml version=\"1.0\"?><svg/>", "an XML file", "foxhunt locate walk.csv LEVELS"),
        (b"\x01\x02\0\x03\n\x04", "binary", "CSV"),
    ] {
        let error = problem(bytes);
        for part in ["walk.csv: this is", what, command] {
            assert!(error.contains(part), "{error}");
        }
        assert!(error.chars().all(|c| !c.is_control() && c != '\u{fffd}'), "{error:?}");
    }
}

/// `date -u -d '2026-06-21 14:03' +%s`
const SUMMER: f64 = 1_782_050_580.0;

#[test]
fn times_of_spreadsheets_are_read() {
    use foxhunt_archive::recording::TimeFormat;

    let times = |text: &str, options: &ReadOptions| {
        let recording = read(text, options)?;
        let times = recording.records().iter().filter_map(|record| record.time);
        Ok::<_, RecordingError>((recording.is_in_utc(), times.collect::<Vec<f64>>()))
    };
    let default = ReadOptions::default();
    for (header, cell) in [
        ("time", "21.06.2026 14:03"),
        ("time", "6/21/2026 2:03 PM"),
        ("time", "2026-06-21T16:03+02:00"),
        ("time", "1782050580"),
        ("Date", "46194.585416666669"),
        ("time_utc", "46194.585416666669"),
        ("Date;Time", "2026-06-21;14:03"),
        ("Datum;Uhrzeit", "21.06.26;14:03:00"),
    ] {
        let text = format!("{header};x;y;rssi\n{cell};0;0;-60\n");
        let (in_utc, seconds) = times(&text, &default).expect(cell);
        assert!(in_utc, "{cell}");
        assert!(seconds.iter().all(|second| (second - SUMMER).abs() < 1e-3), "{cell}: {seconds:?}");
    }
    let clock = times("time;x;y;rssi\n14:03;0;0;-60\n14:05;9;0;-61\n", &default);
    assert_eq!(clock.expect("clocks"), (false, vec![50_580.0, 50_700.0]));
    let zone = default.clone().with_time_zone("+02:00".parse().expect("an offset"));
    let local = times("time;x;y;rssi\n21.06.2026 16:03;0;0;-60\n", &zone);
    assert_eq!(local.expect("a date"), (true, vec![SUMMER]));
    // One row shows the order of all; without one it is asked for.
    let open = "Zeit;x;y;rssi\n3/4/2026 10:00;0;0;-60\n5/4/2026 10:00;9;0;-61\n";
    let error = times(open, &default).expect_err("3 April, or March 4").to_string();
    for part in ["walk.csv, line 2, Zeit", "3/4/2026 10:00", "--time-format dmy or mdy"] {
        assert!(error.contains(part), "{error}");
    }
    let april = utc_seconds("2026-04-03 10:00:00").expect("a time");
    let shown = format!("{open}25/4/2026 10:00;18;0;-62\n");
    assert_eq!(times(&shown, &default).expect("shown").1[0].to_bits(), april.to_bits());
    for (format, expected) in
        [(TimeFormat::Dmy, "2026-04-03 10:00:00"), (TimeFormat::Mdy, "2026-03-04 10:00:00")]
    {
        let stated = times(open, &default.clone().with_time_format(format)).expect("stated");
        assert_eq!(Some(stated.1[0]), utc_seconds(expected));
    }
}

#[test]
fn places_are_read_as_people_write_them() {
    let expected = plain("lat,lon,rssi\n48.2008333333,16.3725,-60\n48.21,16.38,-61\n");
    let origin = expected.frame().expect("degrees").origin();
    for text in [
        "lat;lon;rssi\n48°12′3″N;16°22′21″E;-60\n48.21;16.38;-61\n",
        "lat;lon;rssi\nN 48 12.05;E 16 22.35;-60\n48.21;16.38;-61\n",
        "lat,lon,rssi\n482008333,163725000,-60\n482100000,163800000,-61\n",
        "Breite;Länge;Pegel\n48,2008333333;16,3725;-60\n48,21;16,38;-61\n",
    ] {
        let recording = plain(text);
        let found = recording.frame().expect("degrees").origin();
        let off = (found.lat_deg - origin.lat_deg).abs() + (found.lon_deg - origin.lon_deg).abs();
        assert!(off < 2e-7, "{text}: {found:?}");
        assert_eq!(recording.records().len(), 2, "{text}");
    }
    let wrong = "lat;lon;rssi\n48°12'N;16°22'O;-60\n48°12'E;16.4;-60\n48°12'N;16°22'E;-61\n\
                 48.21;16.38;-61\n";
    let recording = plain(wrong);
    let remark = recording.remarks().iter().find(|remark| remark.code == "rows-left-out");
    let text = &remark.expect("two rows").text;
    for part in ["line 2, lon", "East (Ost) or West", "line 3, lat", "hemisphere"] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn windows_1252_is_read_and_a_damaged_cell_is_one_bad_row() {
    let text = "Länge;Breite;Pegel;Empfänger\n16,3725;48,2;-60;Süd\n16,38;48,21;-61;Süd\n";
    let bytes: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).expect("Latin")).collect();
    let recording = plain(bytes);
    assert_eq!(recording.drones(), ["Süd"]);
    let mut damaged = text.replace("61;Süd", "61;S?").into_bytes();
    let at = damaged.iter().rposition(|byte| *byte == b'?').expect("a place");
    damaged[at] = 0xfc;
    let damaged = plain(damaged);
    assert_eq!((damaged.drones(), damaged.records().len()), (vec!["Süd"], 1));
}

#[test]
fn utm_with_a_zone_is_degrees() {
    let rows = "601983.2525,5339533.0871,33U,-60\n602083.2525,5339533.0871,33U,-61\n";
    let metres = rows.replace(",33U", "");
    let zone = ReadOptions::default().with_utm_zone("33 north".parse().expect("a zone"));
    let mapping = "name = 'n'\ndescription = 'd'\nutm_zone = 'z'\n[columns]\n\
                   east_m = { column = 'e', scale = 1000 }\nnorth_m = 'n'\nrss_db = 'l'\n";
    let mapping = Mapping::parse(mapping, "n.toml").expect("a mapping");
    let mapped = ReadOptions::default().with_format(mapping);
    for (text, options) in [
        (format!("easting,northing,zone,rssi\n{rows}"), &ReadOptions::default()),
        (format!("easting,northing,rssi\n{metres}"), &zone),
        (format!("east_m,north_m,rss_db\n{metres}"), &zone),
        ("e,n,z,l\n601.9832525,5339533.0871,33U,-60\n".to_owned(), &mapped),
    ] {
        let recording = read(&text, options).expect(&text);
        let origin = recording.frame().expect("degrees").origin();
        let off = (origin.lat_deg - 48.200_833_3).abs() + (origin.lon_deg - 16.3725).abs();
        assert!(off < 1e-8, "{text}: {origin:?}");
    }
    // Without a zone metres stay what they are.
    let recording = plain(format!("easting,northing,rssi\n{metres}"));
    assert!(recording.frame().is_none());
    let header = "easting,northing,zone,rssi";
    for (row, part) in [
        ("601983,5339533,33S,-60", "line 2, zone: \"33S\" may be the southern hemisphere"),
        ("601983,5339533,33,-60", "has no hemisphere"),
        ("48.2,-5339533,33U,-60", "line 2, northing: \"-5339533\" is not between"),
        (",5339533,33U,-60", "line 2, easting: \"\" must not be empty"),
    ] {
        let error = problem(format!("{header}\n{row}\n"));
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn a_slip_in_a_name_is_asked_for_before_what_lacks() {
    let error = problem("time_s,lat_deg,lon_deg,rss_dmb\n0,50,14,-60\n");
    assert!(error.contains("is \"rss_dmb\" meant to be \"rss_dbm\"?"), "{error}");
    for (header, question) in [
        ("time,lat,lon,rsi", "is \"rsi\" meant to be \"rssi\"?"),
        ("time,lattitude,longitud,rssi", "is \"lattitude\" meant to be \"latitude\"?"),
        ("time,lat,lon,baering", "is \"baering\" meant to be \"bearing\"?"),
    ] {
        let error = problem(format!("{header}\n0,50,14,-60\n"));
        assert!(error.contains(question), "{error}");
    }
}

/// A misspelt σ would make the answer another one in silence.
#[test]
fn a_slip_in_a_column_that_may_lack_is_asked_for() {
    let rows = "0,0,45,15\n90,0,315,15\n";
    let recording = plain(format!("east_m,north_m,bearing,bearing_sigm_deg\n{rows}"));
    assert_eq!(codes(&recording), ["columns-by-name", "column-not-used"]);
    let remark = &recording.remarks()[1];
    assert!(remark.text.contains("meant to be \"bearing_sigma_deg\"?"), "{remark}");
    let other = plain(format!("east_m,north_m,bearing,temperature\n{rows}"));
    assert_eq!(codes(&other), ["columns-by-name"]);
    // A name of ours that a mapping leaves out is no slip.
    let mapping = "name = 'n'\ndescription = 'd'\n[columns]\nrss_dbm = 'a'\nrange_m = 'b'\n";
    let mapping = Mapping::parse(mapping, "n.toml").expect("a mapping");
    let options = ReadOptions::default().with_format(mapping);
    let left_out = read("a,b,range_sigma_m\n-60,5,1\n", &options).expect("a row");
    assert_eq!(codes(&left_out), ["column-not-used"]);
    let text = &left_out.remarks()[0].text;
    assert!(
        text.ends_with("\"range_sigma_m\" is not used; the format n does not name it"),
        "{text}"
    );
}

#[test]
fn a_date_is_no_number_of_seconds_and_a_comma_no_point() {
    let rows = "2026-06-01T00:00:00,50,14,-60\n2026-06-01T00:00:10,50.001,14,-61\n";
    let error = problem(format!("time_s,lat_deg,lon_deg,rss_dbm\n{rows}"));
    assert!(error.contains("call the column time_utc"), "{error}");
    let error = problem("time,lat,lon,rssi\n0,50,1,14,2,-60,5\n1,50,1,14,3,-61,0\n");
    assert!(error.contains("numbers with a decimal comma need quotes"), "{error}");
}
