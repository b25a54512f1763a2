//! Files of other shapes than a table. Spreadsheets and the log of Kismet are those of
//! `tests/data/shapes/make.py`: one walk of 200 s, written by other programs.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::path::PathBuf;

use foxhunt_archive::recording::{ReadOptions, Recording, RecordingError, Rover};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

/// The beginning of the walk, 2026-06-21 14:03:00 UTC.
const BEGIN: f64 = 1_782_050_580.0;

fn path(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/shapes")).join(name)
}

fn read(name: &str, options: &ReadOptions) -> Result<Recording, RecordingError> {
    Recording::read(path(name), options)
}

fn text(name: &str, text: &str) -> Result<Recording, RecordingError> {
    Recording::from_reader(text.as_bytes(), name, &ReadOptions::default())
}

/// Text of the remark on the file's shape.
fn shape(recording: &Recording) -> String {
    let remarks = recording.remarks().iter();
    let of_shape = remarks.filter(|remark| remark.code == "converted");
    of_shape.map(|remark| remark.text.to_string()).collect()
}

/// Distance of the path from that of the walk after some seconds, in metres, and the level there.
fn off_m(recording: &Recording, second: f64, east: f64, north: f64) -> (f64, f64) {
    let mut records = recording.records().iter();
    let at = |time: Option<f64>| time.is_some_and(|time| (time - BEGIN - second).abs() < 0.5);
    let record = records.find(|record| at(record.time)).expect("a row of that second");
    let frame = recording.frame().expect("places in degrees");
    let begin =
        LocalFrame::new(Geodetic { lat_deg: 48.2, lon_deg: 16.37, alt_m: frame.origin().alt_m });
    let place = record.receiver().expect("a place").position;
    let local = begin.expect("a place").to_local(&frame.to_geodetic(&place));
    // A degree of the script's sphere is not that of the ellipsoid to 0.4 %.
    ((local.x - east).hypot(local.y - north), record.rss_dbm.expect("a level"))
}

#[test]
fn spreadsheets_are_tables_with_dates() {
    for name in ["walk.xlsx", "walk.ods"] {
        let recording = read(name, &ReadOptions::default()).expect(name);
        assert_eq!(recording.records().len(), 200, "{name}");
        for (second, east, north) in [(0.0, 0.0, 0.0), (60.0, 240.0, 0.0), (125.0, 300.0, 150.0)] {
            let (off, level) = off_m(&recording, second, east, north);
            assert!(off < 2.0, "{name}, {second} s: {off} m");
            let away = (north - 100.0).hypot(east - 111.0);
            let expected = -40.0 - 25.0 * away.log10() + 3.0 * (1.7 * second).sin();
            assert!((level - expected).abs() < 1e-6, "{name}: {level} for {expected}");
        }
    }
    // The rows have the numbers that the program of the spreadsheet shows.
    let recording = read("walk.xlsx", &ReadOptions::default()).expect("it is read");
    assert_eq!(recording.records()[0].line, 3);
    let said = shape(&recording);
    assert!(said.contains("sheet \"Walk\"") && said.contains("--sheet: Notes"), "{said}");
}

#[test]
fn a_sheet_is_chosen_by_its_name_or_refused_with_the_others() {
    let named = |sheet: &str| read("walk.xlsx", &ReadOptions::default().with_sheet(sheet));
    assert_eq!(named("Walk").expect("it is there").records().len(), 200);
    let error = named("Sheet1").expect_err("it is not there").to_string();
    assert!(error.contains("\"Sheet1\"") && error.contains("Notes, Walk"), "{error}");
    let options = ReadOptions::default().with_sheet("Walk");
    let error = Recording::from_reader("lat,lon,rssi\n".as_bytes(), "walk.csv", &options);
    let error = error.expect_err("no spreadsheet").to_string();
    assert!(error.contains("walk.csv: there is no sheet \"Walk\""), "{error}");
}

#[test]
fn packets_of_kismet_with_level_and_place_are_rows() {
    let recording = read("walk.kismet", &ReadOptions::default()).expect("a log of Kismet");
    assert_eq!(recording.records().len(), 180);
    let record = &recording.records()[0];
    assert_eq!(record.beacon.as_deref(), Some("02:00:00:00:00:01"));
    assert_abs_diff_eq!(record.time.expect("a time") - BEGIN, 0.25, epsilon = 1e-6);
    let (off, level) = off_m(&recording, 60.0, 240.0, 0.0);
    assert!(off < 2.0 && (level - level.round()).abs() < 1e-9, "{off} m, {level} dBm");
    assert!(shape(&recording).contains("180 of 200"), "{}", shape(&recording));
}

/// The file is as a program leaves it that writes ahead.
#[test]
fn lines_of_bearing_of_df_aggregator_are_bearings_of_its_stations() {
    let recording = read("bearings.db", &ReadOptions::default()).expect("a database");
    assert!(shape(&recording).contains("18 of 24"), "{}", shape(&recording));
    assert_eq!(recording.drones(), ["hill", "mast", "car"]);
    assert_eq!(recording.beacons(), [Some("433.92")]);
    let frame = recording.frame().expect("places in degrees");
    let fox = Geodetic { lat_deg: 48.2009, lon_deg: 16.3715, alt_m: 0.0 };
    let fox = frame.to_local(&fox);
    for (record, number) in recording.records().iter().zip((0..).filter(|n| n % 4 != 3)) {
        assert_abs_diff_eq!(
            record.time.expect("a time") - BEGIN,
            f64::from(number),
            epsilon = 1e-6
        );
        let place = record.receiver().expect("a place").position;
        let bearing = record.bearing.as_ref().expect("a bearing").angle;
        let off = bearing - (fox.y - place.y).atan2(fox.x - place.x);
        // The script's errors are clockwise; its sphere is off by 0.1°.
        let expected = -2.0 * (2.3 * f64::from(number)).sin();
        let off_deg = off.sin().asin().to_degrees() - expected;
        assert!(abs_diff_eq!(off_deg, 0.0, epsilon = 0.25), "line {number}: {off_deg}°");
    }
}

#[test]
fn tags_of_a_sensorgnome_are_rows_of_its_place() {
    let recording = text(
        "all.txt",
        "S,1557437990.1,1,frequency,166.376,0,\nG,1557437999,44.34,-66.11,21.6\n\
         T1,1557438000.263,78664C33,-51\nT1,1557438005.263,78664C33,-53\n\
         T2,1557438001.5,AA,-63\np1,1557437995.6384,3.883,-49.09,-71.03\n",
    );
    let recording = recording.expect("a file of a SensorGnome");
    let records = recording.records();
    assert_eq!(records.len(), 3);
    assert_eq!(records[0].beacon.as_deref(), Some("78664C33"));
    assert_eq!((records[1].rss_dbm, records[1].line), (Some(-53.0), 4));
    assert!(shape(&recording).contains("foxhunt tags"), "{}", shape(&recording));
}

#[test]
fn reports_of_direction_finders_by_aprs_are_bearings() {
    let recording = text(
        "aprs.txt",
        "K1>APRS:!4812.00N/01622.20E\\000/000/045/518\n\
         K2>APRS:!4812.00N/01623.20E\\000/000/315/516\n\
         K3>APRS:!4812.00N/01623.20E-no direction finder\n",
    );
    let recording = recording.expect("packets");
    let records = recording.records();
    assert_eq!(records.len(), 2);
    let sigmas: Vec<f64> = records
        .iter()
        .map(|record| {
            record.bearing.as_ref().expect("a bearing").sigma.expect("known").to_degrees()
        })
        .collect();
    assert_abs_diff_eq!(sigmas[0], 1.0, epsilon = 1e-9);
    assert_abs_diff_eq!(sigmas[1], 4.0, epsilon = 1e-9);
}

#[test]
fn a_track_of_kml_is_a_path() {
    let track = r#"<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">
<Document><Placemark><gx:Track>
<when>2026-06-21T14:03:00Z</when><when>2026-06-21T14:03:10Z</when>
<gx:coord>16.37 48.2 230</gx:coord><gx:coord>16.38 48.2 240</gx:coord>
</gx:Track></Placemark>
<Placemark><TimeStamp><when>2026-06-21T14:03:20Z</when></TimeStamp>
<Point><coordinates>16.39,48.2,250</coordinates></Point></Placemark>
</Document></kml>"#;
    assert!(Rover::is_track(track.as_bytes()));
    let rover = Rover::parse(track.as_bytes(), "track.kml").expect("a track");
    for (second, lon_deg, alt_m) in
        [(0.0, 16.37, 230.0), (5.0, 16.375, 235.0), (15.0, 16.385, 245.0)]
    {
        let place = rover.place(BEGIN + second).expect("on the track");
        let off = (place.lon_deg - lon_deg).abs() + 1e-3 * (place.alt_m - alt_m).abs();
        assert!(off < 1e-9, "{second} s: {place:?}");
    }
    assert_eq!(rover.place(BEGIN + 21.0), None);
    // A place that is missing leaves its time out, and one too few names the line.
    let without = track.replace("<gx:coord>16.37 48.2 230</gx:coord>", "<gx:coord/>");
    let rover = Rover::parse(without.as_bytes(), "track.kml").expect("a track");
    assert_eq!(rover.place(BEGIN + 5.0), None);
    assert_abs_diff_eq!(rover.place(BEGIN + 10.0).expect("a point").lon_deg, 16.38, epsilon = 1e-9);
    let fewer = track.replace("<gx:coord>16.37 48.2 230</gx:coord>", "");
    let error = Rover::parse(fewer.as_bytes(), "track.kml").expect_err("a place is missing");
    assert!(error.to_string().contains("line 6: ") && error.to_string().contains("2 times and 1"));
    let error = Rover::parse(track.replace("48.2 240", "98.2 240").as_bytes(), "track.kml");
    let error = error.expect_err("no such latitude").to_string();
    assert!(error.contains("track.kml, line 5") && error.contains("98.2"), "{error}");
}

#[test]
fn the_track_in_a_kmz_file_is_a_path() {
    let bytes = std::fs::read(path("walk.kmz")).expect("it is in the repository");
    assert!(Rover::is_track(&bytes));
    assert!(!Rover::is_track(&std::fs::read(path("walk.ods")).expect("it is in the repository")));
    let rover = Rover::parse(&bytes, "walk.kmz").expect("a track");
    let frame = LocalFrame::new(rover.begin()).expect("a place");
    for (second, east, north) in [(0.0, 0.0, 0.0), (60.5, 242.0, 0.0), (125.0, 300.0, 150.0)] {
        let local = frame.to_local(&rover.place(BEGIN + second).expect("on the track"));
        let off = (local.x - east).hypot(local.y - north);
        assert!(off < 2.0 && (local.z - 0.1 * second).abs() < 0.05, "{second} s: {local}");
    }
    let error = read("walk.kmz", &ReadOptions::default()).expect_err("no levels").to_string();
    assert!(error.contains("a KML file") && error.contains("LEVELS.csv"), "{error}");
    let cut = Rover::parse(&bytes[..bytes.len() - 30], "walk.kmz").expect_err("no directory");
    assert!(cut.to_string().contains("walk.kmz"), "{cut}");
}

/// Begins of files that gzip compressed show their kind, too.
#[test]
fn a_track_that_gzip_compressed_is_one_by_its_begin() {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    let gpx = include_bytes!("../../data/rover.gpx");
    std::io::Write::write_all(&mut packed, gpx).expect("memory");
    let packed = packed.finish().expect("memory");
    assert!(Rover::is_track(&packed[..packed.len() / 2]));
    let whole = Rover::parse(gpx, "rover.gpx").expect("a track");
    assert_eq!(Rover::parse(&packed, "rover.gpx").expect("a track"), whole);
}

/// Three bearings drawn on a map, to a transmitter at 48.2009 N, 16.3715 E.
#[test]
fn lines_of_two_points_are_bearings() {
    let lines: String = [(48.198, 16.37), (48.199, 16.376), (48.204, 16.369)]
        .into_iter()
        .map(|(lat, lon)| {
            let [north, east] = [lat + 0.7 * (48.2009 - lat), lon + 0.7 * (16.3715 - lon)];
            format!(
                "<Placemark><name>by hand</name><LineString><coordinates>\n\t{lon},{lat},0 \
                 {east},{north},0\n</coordinates></LineString></Placemark>\n"
            )
        })
        .collect();
    let whole = format!("<?xml version=\"1.0\"?><kml><Document>{lines}</Document></kml>");
    assert!(!Rover::is_track(whole.as_bytes()), "several such files are several recordings");
    let recording = text("map.kml", &whole).expect("bearings");
    assert!(shape(&recording).contains("3 lines 3 have two points"), "{}", shape(&recording));
    let frame = recording.frame().expect("places in degrees");
    let fox = Geodetic { lat_deg: 48.2009, lon_deg: 16.3715, alt_m: 0.0 };
    let fox = frame.to_local(&fox);
    for record in recording.records() {
        let place = record.receiver().expect("a place").position;
        let expected = (fox.y - place.y).atan2(fox.x - place.x);
        let bearing = record.bearing.as_ref().expect("a bearing").angle;
        assert_abs_diff_eq!((bearing - expected).sin(), 0.0, epsilon = 2e-4);
    }
}

/// Files of other shapes with bytes changed at random, or cut off, are read or refused.
#[test]
fn damaged_files_are_read_or_refused() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(17);
    let bearing = "<?xml version=\"1.0\"?><kml><Placemark><name>a</name><LineString><coordinates>\
                   16.37,48.2,0 16.37,48.3,0</coordinates></LineString></Placemark></kml>";
    let logger = "# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,UnixTimeMillis\n\
                  Fix,GPS,48.2,16.37,230,1782050580000\nFix,GPS,48.21,16.37,,1782050581000\n";
    let mut files = vec![bearing.as_bytes().to_vec(), logger.as_bytes().to_vec()];
    for name in [
        "walk.kmz",
        "bearings.db",
        "../wildlife/srx800.DTA",
        "../wildlife/srx1200.csv",
        "../receivers/ats-aerial.csv",
        "../receivers/ats-aerial-utm.csv",
        "../receivers/tinygs.txt",
        "../receivers/xctu.log",
    ] {
        files.push(std::fs::read(path(name)).expect(name));
    }
    for whole in &files {
        for _ in 0..60 {
            let mut damaged = whole.clone();
            for _ in 0..rng.random_range(1..8) {
                let index = rng.random_range(0..damaged.len());
                damaged[index] = rng.random();
            }
            if rng.random_bool(0.3) {
                damaged.truncate(rng.random_range(0..damaged.len()));
            }
            let _ = Rover::is_track(&damaged) || Rover::is_path_table(&damaged);
            if let Ok(rover) = Rover::parse(&damaged, "damaged") {
                assert_abs_diff_eq!(rover.begin().lat_deg, 0.0, epsilon = 90.0);
            }
            let read = Recording::from_reader(&damaged[..], "damaged", &ReadOptions::default());
            for record in read.iter().flat_map(Recording::records) {
                let place = record.receiver().map(|receiver| receiver.position);
                assert!(place.is_none_or(|place| place.iter().all(|metres| metres.is_finite())));
            }
        }
    }
}

/// Detections of CTT's nodes, whose places are beside them; the station's own have no node.
#[test]
fn detections_of_nodes_have_the_places_of_the_nodes() {
    let recording = read("../ctt/detections.csv", &ReadOptions::default());
    let recording = recording.expect("detections");
    assert_eq!((recording.format(), recording.records().len()), ("ctt", 2));
    let places: Vec<_> =
        recording.records().iter().map(|r| r.receiver().expect("a place")).collect();
    let apart = (places[1].position - places[0].position).norm();
    assert_abs_diff_eq!(apart, 222.2, epsilon = 0.3);
    assert_eq!(recording.beacons(), [Some("78664C33")]);
}

/// Bearings of two animals, as sigloc and LOAS have them, are of two beacons.
#[test]
fn an_animal_is_a_beacon() {
    let table = "Animal,Date,Time,Easting,Northing,Azimuth\n\
                 F01,2016-04-05,10:01,530000,5338000,45\nF02,2016-04-05,10:05,531000,5338000,315\n";
    let recording = text("loas.csv", table).expect("bearings");
    assert_eq!(recording.beacons(), [Some("F01"), Some("F02")]);
}

/// One cell holds latitude and longitude, a place of UTM with its zone, or a grid reference.
#[test]
fn a_place_in_one_cell_is_a_place() {
    for (name, places) in [
        ("lat/lon", ["\"48.2000, 16.3700\"", "\"48.2000, 16.3800\""]),
        ("UTM", ["33U 601799.15 5339437.15", "33U 602542.19 5339450.45"]),
        ("MGRS", ["33U XP 01799 39437", "33UXP0254239450"]),
    ] {
        let [from, to] = places;
        let recording = text("f.csv", &format!("{name},bearing\n{from},45\n{to},315\n"));
        let recording = recording.unwrap_or_else(|error| panic!("{name}: {error}"));
        let places: Vec<_> =
            recording.records().iter().map(|r| r.receiver().expect("a place")).collect();
        let apart = (places[1].position - places[0].position).norm();
        assert_abs_diff_eq!(apart, 743.4, epsilon = 1.0);
        assert_eq!(recording.records().len(), 2, "{name}");
    }
    let unclear = text("f.csv", "UTM,bearing\n33S 601799 5339436,45\n33S 602541 5339449,315\n");
    let unclear = format!("{:?}", unclear.map_err(|error| error.to_string()));
    assert!(unclear.contains("band S"), "{unclear}");
}

/// Levels that fall from -50 to -80 dB, with another cell in every fifth row.
fn with_cell(cell: &str) -> String {
    let mut table = String::from("time,lat,lon,rssi\n");
    for row in 0..40_i32 {
        let level = if row % 5 == 0 { cell.to_owned() } else { (-50 - row % 31).to_string() };
        table += &format!("{row},{},16.37,{level}\n", 48.2 + 1e-4 * f64::from(row));
    }
    table
}

/// A code that receivers write where they have no reading is no level.
#[test]
fn a_code_for_no_reading_is_left_out() {
    for code in ["127", "0", "99", "-127", "-128", "-200"] {
        let recording = text("f.csv", &with_cell(code)).expect("a table");
        assert_eq!(recording.records().len(), 32, "{code}");
        let remarks = recording.remarks();
        assert!(remarks.iter().any(|remark| remark.text.contains("stands for no reading")));
        assert!(remarks.iter().all(|remark| remark.code != "receiver-at-ceiling"), "{remarks:?}");
    }
    // A level that others lead up to is one.
    for level in ["-50", "-40", "-25", "-100", "-120"] {
        let recording = text("f.csv", &with_cell(level)).expect("a table");
        assert_eq!(recording.records().len(), 40, "{level}");
    }
}

#[test]
fn our_own_columns_may_stand_beside_a_receiver_of_another_name() {
    for name in ["drone", "receiver", "station", "node", "gateway"] {
        let table = format!(
            "time_s,{name},lat_deg,lon_deg,rss_dbm\n0,a,48.2,16.37,-60\n1,b,48.3,16.5,-61\n"
        );
        let recording = text("f.csv", &table).expect("a table");
        let of: Vec<&str> = recording.records().iter().map(|record| &*record.drone).collect();
        assert_eq!(of, ["a", "b"], "{name}");
        assert_eq!(recording.remarks().len(), 0, "{name}: {:?}", recording.remarks());
    }
}

#[test]
fn levels_without_their_sign_have_a_hint() {
    let table = "time,lat,lon,RSSI [dBm]\n0,48.2,16.37,107\n1,48.2001,16.37,109\n";
    let error = text("f.csv", table).expect_err("no receiver survives 107 dBm");
    assert!(error.to_string().contains("--negate-levels"), "{error}");
    let table = "time,lat,lon,signal\n0,48.2,16.37,57\n1,48.2001,16.37,95\n";
    let recording = text("f.csv", table).expect("a table");
    assert!(recording.remarks().iter().any(|remark| remark.code == "positive-levels"));
}

/// Rows that two files have count once.
#[test]
fn a_file_that_is_given_twice_counts_once() {
    let folder = std::env::temp_dir().join(format!("foxhunt-copies-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let [first, second] = ["a.csv", "b.csv"].map(|name| folder.join(name));
    for path in [&first, &second] {
        std::fs::write(path, with_cell("-60")).expect("a file");
    }
    let read = Recording::read_all([&first, &second], &ReadOptions::default());
    let recordings = read.expect("two files");
    assert_eq!(recordings.len(), 1);
    let remarks = recordings[0].remarks();
    assert!(remarks.iter().any(|remark| remark.code == "duplicate-rows"), "{remarks:?}");
    std::fs::remove_dir_all(&folder).expect("it is there");
}
