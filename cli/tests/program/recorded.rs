use std::{fmt::Write as _, fs, path::Path};

use crate::support::{folder, foxhunt, has};

fn write(folder: &Path, name: &str, text: &str) -> String {
    let file = folder.join(name);
    fs::write(&file, text).expect("the folder can be written to");
    file.to_str().expect("the target folder is UTF-8").to_owned()
}

/// One turn of a smooth lobe that looks to 120° compass.
fn sweep() -> String {
    let mut text = "drone,turn,time_s,east_m,north_m,boresight_deg_compass,rss_dbm\n".to_owned();
    for position in 0..128 {
        let boresight = 2.8125 * f64::from(position);
        let off = (boresight - 120.0).to_radians().cos();
        let rss = -75.0 + 15.0 * off;
        writeln!(text, "uav1,0,{position},0,0,{boresight},{rss}").expect("a text takes it all");
    }
    text
}

#[test]
fn a_turn_has_a_bearing() {
    let folder = folder("bearing");
    let file = write(&folder, "sweep.csv", &sweep());
    let report = foxhunt(["bearing", "--json", &file]).json();
    let turn = &report["turns"][0];
    has(
        turn,
        &[
            "rss_dbm",
            "rss_sigma_db",
            "bearing_deg_compass",
            "bearing_sigma_deg",
            "confidence",
            "low_confidence",
        ],
    );
    // Whole-dB rounding makes a plateau of positions about the maximum; it is symmetric to
    // within half a position.
    let bearing = turn["bearing_deg_compass"].as_f64().expect("a number");
    assert!((bearing - 120.0).abs() < 3.0, "{bearing}");
    // The mean of the cosine over a turn is nothing.
    assert!((turn["rss_dbm"].as_f64().expect("a number") + 75.0).abs() < 1e-9);
    let table = foxhunt(["bearing", &file]);
    assert!(table.code == 0 && table.stdout.contains("uav1"), "{table:?}");
}

#[test]
fn bearings_cross_at_the_transmitter() {
    let folder = folder("locate");
    let text = "time_s,east_m,north_m,bearing_deg_compass,bearing_sigma_deg,truth_east_m,truth_north_m\n\
                0,0,0,45,3,50,50\n1,100,0,315,3,50,50\n2,50,-20,0,3,50,50\n";
    let file = write(&folder, "bearings.csv", text);
    let report = foxhunt(["locate", "--json", &file]).json();
    has(&report, &["estimate", "error_m", "observations", "rejected"]);
    has(&report["estimate"], &["lat_deg", "lon_deg", "east_m", "north_m", "covariance_m2"]);
    assert_eq!(report["observations"], 3);
    let error = report["error_m"].as_f64().expect("the truth is in the file");
    // The ellipse of three bearings of 3° from 70 m is some 4 m.
    assert!(error < 10.0, "{error}");
    let table = foxhunt(["locate", &file, "--estimator", "ukf"]);
    assert!(table.code == 0 && table.stdout.contains("ukf"), "{table:?}");
    foxhunt(["locate", &file, "--truth", "50,14"]).failed(2, &["--truth", "truth_east_m"]);
}

#[test]
fn degrees_come_back_as_degrees() {
    let folder = folder("degrees");
    // The second place is 0.001° to the East, 71.7 m at this latitude; the beacon between them and
    // as far to the North.
    let text = "time_s,lat_deg,lon_deg,alt_agl_m,bearing_deg_compass,bearing_sigma_deg\n\
                0,50,14,0,45,2\n1,50,14.001,0,315,2\n2,50,14.0005,0,0,2\n";
    let file = write(&folder, "degrees.csv", text);
    let truth = "50.000322,14.0005";
    let report = foxhunt(["locate", "--json", &file, "--truth", truth]).json();
    let estimate = &report["estimate"];
    let (lat, lon) = (estimate["lat_deg"].as_f64(), estimate["lon_deg"].as_f64());
    assert!((lat.expect("a number") - 50.000_322).abs() < 1e-4, "{estimate}");
    assert!((lon.expect("a number") - 14.000_5).abs() < 1e-4, "{estimate}");
    assert!(report["error_m"].as_f64().expect("a number") < 10.0, "{report}");
}

#[test]
fn a_known_path_loss_gives_the_range() {
    let folder = folder("known_power");
    // Four places about a transmitter at (20, 10), the levels from −30 dBm and an exponent of 2.
    let mut text = "east_m,north_m,rss_dbm,truth_east_m,truth_north_m\n".to_owned();
    for (east, north) in [(0.0_f64, 0.0_f64), (50.0, 0.0), (0.0, 40.0), (50.0, 40.0)] {
        let rss = -30.0 - 20.0 * (east - 20.0).hypot(north - 10.0).log10();
        writeln!(text, "{east},{north},{rss},20,10").expect("a text takes it all");
    }
    let file = write(&folder, "levels.csv", &text);
    let error = |power: &[&str]| {
        let args = ["locate", "--json", "--margin-m", "20", &file];
        let report = foxhunt(args.iter().chain(power)).json();
        report["error_m"].as_f64().expect("the truth is in the file")
    };
    let (known, wrong) = (
        error(&["--p0-dbm", "-30", "--exponent", "2"]),
        error(&["--p0-dbm", "-60", "--exponent", "2"]),
    );
    // 30 dB too little is a range that is too short by a factor of 30.
    assert!(known < 15.0 && known < wrong, "{known} {wrong}");
}

#[test]
fn a_straight_flight_has_a_rival_on_the_other_side() {
    let folder = folder("rivals");
    // Along a line to the East, past a transmitter 30 m to the North of it.
    let mut text = "east_m,north_m,up_m,rss_dbm,truth_east_m,truth_north_m\n".to_owned();
    for i in 0..21 {
        let east = 5.0 * f64::from(i);
        let rss = -30.0 - 23.0 * (east - 60.0).hypot(30.0).hypot(10.0).log10();
        writeln!(text, "{east},0,10,{rss},60,30").expect("a text takes it all");
    }
    let file = write(&folder, "straight.csv", &text);
    let args = ["locate", &file, "--estimator", "batch-multistart", "--margin-m", "50"];
    let report = foxhunt(args.iter().chain(&["--json"])).json();
    let rivals = report["rivals"].as_array().expect("a list");
    assert_eq!(rivals.len(), 1, "{report}");
    has(&rivals[0], &["lat_deg", "lon_deg", "east_m", "north_m", "relative_density", "error_m"]);
    let north = |place: &serde_json::Value| place["north_m"].as_f64().expect("a number");
    assert!((north(&rivals[0]) + north(&report["estimate"])).abs() < 0.1, "{report}");
    let error = |found: &serde_json::Value| found["error_m"].as_f64().expect("a number");
    assert!(error(&report).min(error(&rivals[0])) < 5.0, "{report}");
    let table = foxhunt(args);
    assert!(table.code == 0 && table.stdout.contains("relative density"), "{table:?}");

    // Other estimators do not look for rivals, and this one needs bearings.
    let grid = foxhunt(["locate", "--json", &file]).json();
    assert_eq!(grid["rivals"].as_array().map(Vec::len), Some(0), "{grid}");
    foxhunt(["locate", &file, "--estimator", "lenth1981"])
        .failed(2, &["lenth1981", "needs bearings"]);
    let two = write(&folder, "two.csv", "east_m,north_m,bearing_deg_compass\n0,0,45\n9,0,315\n");
    let few = foxhunt(["locate", &two, "--estimator", "lenth1981"]);
    few.failed(2, &["bearings meet", "batch-multistart", "2 bearings, and 3 are needed"]);
    assert_eq!(few.stderr.matches("there are 2").count(), 1, "printed once: {}", few.stderr);
    let map = foxhunt(["locate", "--json", &file, "--estimator", "field-map"]).json();
    assert_eq!(map["estimator"], "field-map");
}

#[test]
fn a_path_loss_is_fitted() {
    let folder = folder("calibrate");
    let mut text = "range_m,rss_dbm\n".to_owned();
    for range in [1.0_f64, 3.0, 10.0, 30.0, 100.0] {
        writeln!(text, "{range},{}", -30.0 - 25.0 * range.log10()).expect("a text takes it all");
    }
    let file = write(&folder, "ranges.csv", &text);
    let report = foxhunt(["calibrate", "--json", &file]).json();
    // The points lie on the law; what is left is rounding.
    assert!((report["p0_dbm"].as_f64().expect("a number") + 30.0).abs() < 1e-9, "{report}");
    assert!((report["exponent"].as_f64().expect("a number") - 2.5).abs() < 1e-9, "{report}");
    let bounded = foxhunt(["calibrate", "--json", &file, "--max-exponent", "2"]).json();
    assert_eq!(bounded["at_bound"], true);
    assert!(foxhunt(["calibrate", &file]).stdout.contains("exponent"));
}

#[test]
fn a_bad_cell_is_named_with_file_line_column_and_value() {
    let folder = folder("bad_cells");
    let file = write(&folder, "bad.csv", "east_m,north_m,rss_dbm\n0,0,-60\n1,0,loud\n");
    for subcommand in ["locate", "calibrate", "bearing"] {
        foxhunt([subcommand, &file]).failed(2, &["bad.csv", "line 3", "rss_dbm", "loud"]);
    }
    let unknown = write(&folder, "unknown.csv", "a,b\n1,2\n");
    foxhunt(["locate", &unknown]).failed(2, &["unknown.csv", "a, b"]);
    foxhunt(["locate", &file, "--format", "no-such-format"]).failed(2, &["no-such-format"]);
    let level = write(&folder, "level.csv", "east_m,north_m,rss_dbm\n0,0,-60\n");
    foxhunt(["calibrate", &level]).failed(2, &["level.csv", "line 2", "--truth"]);
    foxhunt(["locate", &level, "--beacon", "fox"]).failed(2, &["fox"]);
}

#[test]
fn real_flights_when_they_are_there() {
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    let flight = format!("{data}/aerpaw_afar/afar_exp288_loc1_1hz.csv");
    let rotation = |name: &str| format!("{data}/uavrt_rotation/{name}");
    let (low, good) = (rotation("rotation_A_2023-05-22.csv"), rotation("rotation_B_2023-06.csv"));
    if !Path::new(&flight).exists() || !Path::new(&low).exists() {
        println!("skipped: no recordings at {data}");
        return;
    }
    let report = foxhunt(["locate", "--json", &flight, "--truth", "35.72806709,-78.69730398"]);
    assert!(report.stderr.contains("alt_agl_m ≥ 15"), "{}", report.stderr);
    let report = report.json();
    assert!(report["error_m"].as_f64().expect("a number") < 60.0, "{report}");

    // The published estimate (Lenth 1981, table 2) is 0.37 off, its seven bearings of use.
    let bearings = format!("{data}/lenth1981/bearings.csv");
    let report =
        foxhunt(["locate", "--json", &bearings, "--estimator", "lenth1981-andrews"]).json();
    let error = report["error_m"].as_f64().expect("the truth is beside it");
    assert!((error - 0.373).abs() < 0.01 && report["rejected"] == 1, "{report}");

    let of = |file: &str, beacon: &str| {
        foxhunt(["bearing", "--json", file, "--beacon", beacon]).json()["turns"][0].clone()
    };
    assert_eq!(of(&low, "2")["low_confidence"], true);
    let good = of(&good, "4");
    assert_eq!(good["low_confidence"], false);
    let bearing = good["bearing_deg_compass"].as_f64().expect("a number");
    assert!((186.0..=206.0).contains(&bearing), "{bearing}");
}
