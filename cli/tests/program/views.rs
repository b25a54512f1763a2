//! The pages that commands leave besides hunts.

use std::{fs, path::Path};

use serde_json::Value;

use crate::support::{folder, foxhunt};

/// Runs a command with `--report`, and returns what the page shows.
fn shown(args: &[&str], page: &Path) -> Value {
    let ran = foxhunt([args, &["--report", page.to_str().expect("UTF-8")]].concat());
    assert_eq!(ran.code, 0, "{args:?}: {ran:?}");
    assert!(ran.stdout.contains("report: "), "{ran:?}");
    let text = fs::read_to_string(page).expect("a page");
    assert!(!text.contains("src=\"http") && !text.contains("href=\"http"), "no network");
    let data = text.split("type=\"application/json\"").nth(1).expect("its data");
    let data = data.split_once('>').and_then(|(_, rest)| rest.split_once("</script>"));
    serde_json::from_str(data.expect("a script").0).expect("JSON")
}

fn length(value: &Value) -> usize {
    value.as_array().map_or(0, Vec::len)
}

#[test]
fn each_command_leaves_a_page_of_what_it_found() {
    let folder = folder("views");
    let page = folder.join("report.html");
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../archive/tests/data");
    let file = |name: &str| format!("{data}/{name}");
    let bearings = file("otter-telemetry/bearings.csv");
    let turns = file("foxhunt/turns.csv");

    let out = folder.to_str().expect("UTF-8");
    let flown = foxhunt(["--json", "hunt", "one-drone", "--out", out, "--estimator", "ekf"]).json();
    let log = folder.join("hunt.jsonl");
    let replayed = ["replay", log.to_str().expect("UTF-8")];
    let replayed = shown(&replayed, &folder.join("replay.html"));
    assert_eq!(length(&replayed["searches"]), length(&flown["beacons"]));
    assert!(length(&replayed["received"]) > 5, "{replayed}");

    let turned = shown(&["bearing", &turns], &page);
    let json = foxhunt(["--json", "bearing", &turns]).json();
    assert_eq!(length(&turned["received"]), length(&json["turns"]));
    assert_eq!(length(&turned["searches"]), 0);
    assert!(turned["received"][0]["turn"].is_object(), "{}", turned["received"][0]);

    let every = foxhunt(["--json", "locate", &bearings, "--every-beacon"]).json();
    let names: Vec<&str> =
        every.as_array().expect("a list").iter().filter_map(|of| of["beacon"].as_str()).collect();
    assert!(names.len() > 1, "{names:?}");
    let one = shown(&["locate", &bearings, "--beacon", names[0]], &page);
    assert_eq!(length(&one["searches"]), 1);
    let all = shown(&["locate", &bearings, "--every-beacon"], &page);
    let found: Vec<&str> = (all["searches"].as_array().expect("a list").iter())
        .filter_map(|search| search["name"].as_str())
        .collect();
    assert_eq!(found, names);
    assert!(length(&all["received"]) > length(&one["received"]));
}

#[test]
fn a_track_is_a_page_with_its_places_in_time() {
    let folder = folder("track_view");
    let csv = folder.join("stations.csv");
    // Three stations; the transmitter goes East at 1 m/s.
    let mut rows = "drone,beacon,time_s,east_m,north_m,bearing_deg_compass,bearing_sigma_deg,\
                    truth_east_m,truth_north_m\n"
        .to_owned();
    for minute in 0..10_i32 {
        let time = 60 * minute;
        let east = 60 * minute - 300;
        let north = 200;
        for (name, x, y) in [("a", -400, 0), ("b", 400, 0), ("c", 0, 600)] {
            let bearing = f64::from(east - x).atan2(f64::from(north - y)).to_degrees();
            rows += &format!("{name},fox,{time},{x},{y},{bearing:.1},3,{east},{north}\n");
        }
    }
    fs::write(&csv, rows).expect("a file");
    let csv = csv.to_str().expect("UTF-8");
    let args = ["locate", csv, "--track", "--window-s", "60"];
    let report = foxhunt(["--json"].iter().chain(&args)).json();
    let data = shown(&args, &folder.join("track.html"));
    assert_eq!(length(&data["searches"]), 1);
    assert_eq!(length(&report["places"]), 10);
    assert_eq!(length(&data["searches"][0]["beliefs"]), 10, "{}", data["searches"]);
    assert_eq!(length(&data["received"]), 30);
}

#[test]
fn a_page_that_cannot_be_written_stops_the_work_before_it_begins() {
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../archive/tests/data");
    let turns = format!("{data}/foxhunt/turns.csv");
    for args in [&["bearing", &turns][..], &["locate", &turns], &["replay", "no-such-log"]] {
        let ran = foxhunt([args, &["--report", "/no/such/page.html"]].concat());
        ran.failed(1, &["/no/such/page.html", "cannot be written"]);
    }
    let calibrated = foxhunt(["calibrate", &turns, "--out", "/no/such/calibration.toml"]);
    calibrated.failed(1, &["/no/such/calibration.toml", "cannot be written"]);
}

#[test]
fn a_page_brings_its_map_along() {
    let folder = folder("views_map");
    let map = folder.join("map");
    fs::create_dir_all(map.join("3/4")).expect("a folder");
    fs::write(map.join("3/4/2.png"), b"\x89PNG\r\n\x1a\nrest").expect("a tile");
    let [page, map] =
        ["page.html", "map"].map(|name| folder.join(name).to_string_lossy().into_owned());
    let walk = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/walk.csv");
    let ran = foxhunt(["locate", walk, "--report", &page, "--tiles", &map]);
    assert_eq!(ran.code, 0, "{ran:?}");
    let text = fs::read_to_string(&page).expect("a page");
    assert!(text.contains(r#""images":{"3/4/2":"iVBORw0KGgpyZXN0"}"#), "the tile");
    // A map of another place, none, and no page.
    fs::rename(folder.join("map/3/4"), folder.join("map/3/5")).expect("our own");
    let ran = foxhunt(["locate", walk, "--report", &page, "--tiles", &map]);
    assert!(ran.code == 0 && ran.stderr.contains("no tile at this place"), "{ran:?}");
    foxhunt(["locate", walk, "--report", &page, "--tiles", "nowhere"]).failed(2, &["nowhere"]);
    foxhunt(["locate", walk, "--tiles", &map]).failed(2, &["--report"]);
    let metres = concat!(env!("CARGO_MANIFEST_DIR"), "/../archive/tests/data/foxhunt/turns.csv");
    foxhunt(["locate", metres, "--report", &page, "--tiles", &map]).failed(2, &["--origin"]);
}

#[test]
fn a_search_in_silence_reports_where_it_is_not() {
    let folder = folder("views_silent");
    let [recording, page, raster] = ["silent.csv", "silent.html", "silent.tif"]
        .map(|name| folder.join(name).to_string_lossy().into_owned());
    let mut rows = "time_s,lat_deg,lon_deg,rss_dbm,floor_dbm\n".to_owned();
    for step in 0..40 {
        let lon = 14.0 + 0.0002 * f64::from(step);
        rows += &format!("{step},50.0,{lon},-110,-105\n");
    }
    fs::write(&recording, rows).expect("a file");
    let known = ["--p0-dbm", "-30", "--exponent", "2.5"];
    let json = foxhunt([&["--json", "locate", &recording], &known[..]].concat()).json();
    assert_eq!(json["silences"], 40);
    assert!(json["next"]["lat_deg"].is_number() && json["next"]["pod"].is_number(), "{json}");
    let [strong] = json["by_range"].as_array().expect("a list").as_slice() else {
        panic!("one range: {json}")
    };
    assert!((strong["range_m"].as_f64().expect("metres") - 1000.0).abs() < 1e-6);
    let pos = json["pos"].as_f64().expect("a probability");
    assert!(pos > 0.95, "a kilometre covers the area: {pos}");

    let exported = ["--export", raster.as_str()];
    let shown = shown(&[&["locate", recording.as_str()], &exported[..]].concat(), Path::new(&page));
    let pos = shown["searched"]["pos"].as_f64().expect("a probability");
    assert!(0.1 < pos && pos < 0.95, "of all ranges: {pos}");
    assert_eq!(shown["searches"].as_array().map(Vec::len), Some(0));
    assert!(fs::read(&raster).expect("a file").starts_with(b"II*\0"));

    // A single level, and it is a place that is looked for.
    let mut heard = fs::read_to_string(&recording).expect("ours");
    for step in 0..8 {
        let lon = 14.008 + 0.0002 * f64::from(step);
        heard += &format!("{},50.0002,{lon},{},-105\n", 60 + step, -80 - step);
    }
    fs::write(&recording, heard).expect("a file");
    let json = foxhunt(["--json", "locate", &recording]).json();
    assert!(json["estimate"].is_object(), "{json}");
}
