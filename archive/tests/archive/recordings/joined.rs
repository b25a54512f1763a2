//! Names of several columns, tables that are joined, columns side by side, angles beyond a circle,
//! compressed files, other separators.

use std::{
    fs::{self, File},
    io::Write,
    path::PathBuf,
};

use flate2::{Compression, write::GzEncoder};
use foxhunt_archive::recording::{Mapping, ReadOptions, Recording, RecordingError};
use foxhunt_core::angle;
use nalgebra::Vector3;
use proptest::prelude::*;

const STATIONS: &str = r#"
name = "net"
description = "hand-made bearings of a network of stations"
header = ["tower", "az"]
turns = "file"

[columns]
drone = "tower"
beacon = { columns = ["kind", "id"], between = "/" }
time_utc = { columns = ["date", "time"] }
bearing_deg_compass = { column = "az", wrap = true }

[[beside]]
file = "stations.csv"
by = { drone = "name" }
[beside.columns]
east_m = { column = "x_km", scale = 1000 }
north_m = { column = "y_km", scale = 1000 }

[[beside]]
file = "tags.csv"
by = { beacon = { columns = ["kind", "id"], between = "/" } }
columns = { truth_east_m = "x", truth_north_m = "y" }
optional = true
"#;

const ROWS: &str = "tower,kind,id,date,time,az\n\
                    north,hen,1,2026-05-01,10:00:00,400\n\
                    south,hen,2,2026-05-01,10:00:30,-725\n";
const PLACES: &str = "name,x_km,y_km\nsouth,1,-2\nnorth,1.5,2\n";
const TAGS: &str = "kind,id,x,y\nhen,1,7,8\n";

/// A folder of a test's own with these files.
fn folder(name: &str, files: &[(&str, &str)]) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("joined").join(name);
    // What an earlier run left.
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("the test's own folder");
    for (file, text) in files {
        fs::write(folder.join(file), text).expect("the test's own file");
    }
    folder
}

fn options(mapping: &str) -> ReadOptions {
    ReadOptions::default().with_format(Mapping::parse(mapping, "net.toml").expect("a mapping"))
}

fn read(name: &str, files: &[(&str, &str)]) -> Result<Recording, RecordingError> {
    Recording::read(folder(name, files).join("b.csv"), &options(STATIONS))
}

#[test]
fn stations_and_truths_are_joined_by_name() {
    let files = [("b.csv", ROWS), ("stations.csv", PLACES), ("tags.csv", TAGS)];
    let recording = read("whole", &files).expect("it is whole");
    assert_eq!(recording.beacons(), [Some("hen/1"), Some("hen/2")]);
    assert_eq!(recording.drones(), ["north", "south"]);
    let [north, south] = recording.records() else { panic!("{recording:?}") };
    let place = |record: &foxhunt_archive::recording::Record| {
        record.receiver().map(|receiver| receiver.position)
    };
    assert_eq!(place(north), Some(Vector3::new(1500.0, 2000.0, 0.0)));
    assert_eq!(place(south), Some(Vector3::new(1000.0, -2000.0, 0.0)));
    assert_eq!(north.truth.map(|truth| (truth.x, truth.y)), Some((7.0, 8.0)));
    assert_eq!(south.truth, None, "a tag that the table does not hold");
    assert_eq!(south.time.zip(north.time).map(|(south, north)| south - north), Some(30.0));
    // 400° is 40° on the compass, −725° is 355°.
    for (record, compass) in [(north, 40.0_f64), (south, 355.0)] {
        let angle = record.bearing.expect("a bearing").angle;
        assert!(angle::distance(angle, (90.0 - compass).to_radians()) < 1e-12, "{angle}");
    }
    let without = read("no-tags", &files[..2]).expect("the truth is optional");
    assert!(without.records().iter().all(|record| record.truth.is_none()));
}

#[test]
fn what_cannot_be_joined_is_named() {
    for (name, rows, places, parts) in [
        (
            "unknown",
            ROWS.replace("south", "souht"),
            PLACES.to_owned(),
            &["b.csv, line 3", "\"souht\"", "stations.csv", "did you mean \"south\"?"][..],
        ),
        (
            "twice",
            ROWS.to_owned(),
            format!("{PLACES}north,0,0\n"),
            &["stations.csv, line 4", "\"north\"", "in line 3"],
        ),
        (
            "no-number",
            ROWS.to_owned(),
            PLACES.replace("1.5", "far"),
            &["stations.csv, line 3, x_km", "\"far\"", "not a number"],
        ),
        (
            "half",
            ROWS.to_owned(),
            PLACES.replace("1.5", ""),
            &["stations.csv, line 3, x_km", "must not be empty"],
        ),
        (
            "no-column",
            ROWS.to_owned(),
            PLACES.replace("x_km", "xkm"),
            &["stations.csv, line 1", "\"x_km\"", "is \"xkm\" meant to be \"x_km\"?"],
        ),
    ] {
        let files = [("b.csv", rows.as_str()), ("stations.csv", places.as_str())];
        let message = read(name, &files).expect_err(name).to_string();
        for part in parts {
            assert!(message.contains(part), "{name}: {part:?} is not in {message}");
        }
    }
    let message = read("no-stations", &[("b.csv", ROWS)]).expect_err("none").to_string();
    assert!(message.contains("stations.csv"), "{message}");
}

#[test]
fn a_bearing_beyond_the_circle_needs_wrap() {
    let strict = STATIONS.replace("az\", wrap = true", "az\"");
    assert_ne!(strict, STATIONS);
    let folder = folder("strict", &[("b.csv", ROWS), ("stations.csv", PLACES)]);
    let message = Recording::read(folder.join("b.csv"), &options(&strict)).expect_err("400°");
    let message = message.to_string();
    for part in ["line 2, az", "\"400\"", "between -360 and 360"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn a_name_with_a_hole_is_none() {
    let rows = ROWS.replace("hen,2", "hen,");
    let files = [("b.csv", rows.as_str()), ("stations.csv", PLACES), ("tags.csv", TAGS)];
    assert_eq!(read("hole", &files).expect("a bearing").beacons(), [Some("hen/1"), None]);
}

const MELTED: &str = r#"
name = "wide"
description = "one column a receiver"
header = ["at_*"]
[columns]
time_s = "t"
range_m = "d"
[melt]
columns = "at_*"
name = "drone"
value = "rss_dbm"
"#;

#[test]
fn columns_side_by_side_become_rows() {
    let read = |text: &str| {
        Recording::from_reader(text.as_bytes(), "w.csv", &options(MELTED))
            .map_err(|e| e.to_string())
    };
    let wide = read("t,d,at_a,note,at_b\n0,9,-50,x,-60\n1,9,,x,-61\n").expect("two receivers");
    let rows: Vec<_> = wide.records().iter().map(|r| (r.line, &*r.drone, r.rss_dbm)).collect();
    assert_eq!(rows, [(2, "a", Some(-50.0)), (2, "b", Some(-60.0)), (3, "b", Some(-61.0))]);
    assert_eq!(wide.ignored_columns(), ["note"]);
    let half = read("t,d,at_a,at_b\n0,9,-50,loud\n").expect("one of two");
    assert_eq!((half.records().len(), half.remarks().len()), (1, 1));
    for part in ["w.csv", "line 2, at_b", "\"loud\""] {
        assert!(half.remarks()[0].text.contains(part), "{half:?}");
    }
    let message = read("t,d,a\n0,9,-50\n").expect_err("no such column");
    assert!(message.contains("at_*"), "{message}");
}

#[test]
fn compressed_recordings_and_other_separators_read_the_same() {
    let plain = "time_s,east_m,north_m,rss_dbm,beacon\n0,1,2,-50,a;b\n1,3,4,-51,\"c,d\"\n";
    let folder = folder("same", &[("f.csv", plain)]);
    let options = ReadOptions::default();
    let expected = Recording::read(folder.join("f.csv"), &options).expect("plain");
    let variants = [
        (
            "tabs",
            "time_s\teast_m\tnorth_m\trss_dbm\tbeacon\n0\t1\t2\t-50\ta;b\n1\t3\t4\t-51\tc,d\n",
        ),
        ("semi", "time_s;east_m;north_m;rss_dbm;beacon\n0;1;2;-50;\"a;b\"\n1;3;4;-51;c,d\n"),
    ];
    for (name, text) in variants {
        let read = Recording::from_reader(text.as_bytes(), "f.csv", &options).expect(name);
        assert_eq!(read.records(), expected.records(), "{name}");
    }
    // Two members, as logs that are appended to have them.
    let (first, second) = plain.as_bytes().split_at(40);
    let mut bytes = Vec::new();
    for part in [first, second] {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(part).expect("memory");
        bytes.extend(encoder.finish().expect("memory"));
    }
    let path = folder.join("f.csv.gz");
    File::create(&path).and_then(|mut file| file.write_all(&bytes)).expect("the test's own file");
    let read = Recording::read(&path, &options).expect("compressed");
    assert_eq!(read.records(), expected.records());
    assert_eq!(read.drones(), ["f"]);
    let cut = bytes.get(..bytes.len() - 9).expect("longer");
    let message = Recording::from_reader(cut, "f.csv.gz", &options).expect_err("it is cut off");
    assert!(message.to_string().contains("f.csv.gz"), "{message}");
}

#[test]
fn mappings_that_make_no_sense_are_refused() {
    for (from, to, parts) in [
        ("between = \"/\" }\ntime", "betwen = \"/\" }\ntime", &["betwen"][..]),
        ("columns = [\"date\", \"time\"]", "columns = [\"date\"]", &["`columns`", "two or more"]),
        (
            "column = \"az\"",
            "columns = [\"az\", \"id\"], lookup = { a = 1 }",
            &["columns.bearing_deg_compass", "single"],
        ),
        (
            "{ column = \"x_km\", scale = 1000 }",
            "{ column = \"x_km\", wrap = true }",
            &["east_m.wrap"],
        ),
        (
            "east_m = { column = \"x_km\"",
            "east_m = { columns = [\"x_km\", \"x\"]",
            &["own", "added"],
        ),
        ("by = { drone = \"name\" }", "by = { east_m = \"name\" }", &["beside.by", "east_m"]),
        (
            "columns = { truth_east_m",
            "columns = { drone = \"d\", truth_east_m",
            &["beside.columns", "drone"],
        ),
        ("turns = \"file\"", "turns = \"file\"\nseparator = \"x\"", &["separator is x"]),
        ("drone = \"tower\"", "dron = \"tower\"", &["\"dron\"", "did you mean \"drone\"?"]),
    ] {
        assert!(STATIONS.contains(from), "{from}");
        let error = Mapping::parse(&STATIONS.replace(from, to), "net.toml").expect_err(to);
        let source = std::error::Error::source(&error).map(ToString::to_string);
        let message = format!("{error} {}", source.unwrap_or_default());
        for part in parts {
            assert!(message.contains(part), "{to}: {part:?} is not in {message}");
        }
    }
    for (from, to, part) in [
        ("at_*\"\nname", "at_\"\nname", "one * in it"),
        ("name = \"drone\"", "name = \"rss_db\"", "beacon or drone"),
        ("value = \"rss_dbm\"", "value = \"beacon\"", "melt.value"),
        ("value = \"rss_dbm\"", "value = \"range_m\"", "nothing else fills"),
    ] {
        let message =
            Mapping::parse(&MELTED.replace(from, to), "w.toml").expect_err(to).to_string();
        assert!(message.contains(part), "{to}: {message}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        for mapping in [STATIONS, MELTED] {
            let _ = Recording::from_reader(&bytes[..], "x.csv", &options(mapping));
        }
        let mut compressed = vec![0x1f, 0x8b, 8, 0];
        compressed.extend(&bytes);
        let read = Recording::from_reader(&compressed[..], "x.gz", &ReadOptions::default());
        prop_assert!(read.is_err());
    }

    #[test]
    fn no_cells_make_the_reader_panic(
        header in prop::sample::select(
            vec!["t,d,at_a,at_b", "t;d;at_", "d\tt\tat_x", "at_a,at_a,t,d"],
        ),
        rows in prop::collection::vec("[-0-9a-z.,;\t\"#é]{0,24}", 0..8),
    ) {
        let text = format!("{header}\n{}\n", rows.join("\n"));
        if let Ok(read) = Recording::from_reader(text.as_bytes(), "x.csv", &options(MELTED)) {
            prop_assert!(read.records().iter().all(|record| record.rss_dbm.is_some()));
        }
    }
}
