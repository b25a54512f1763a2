use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::{fmt::Write as _, fs, path::Path};

use serde_json::Value;

use crate::support::{folder, foxhunt, has};

fn write(folder: &Path, name: &str, text: &str) -> String {
    let file = folder.join(name);
    fs::write(&file, text).expect("the folder can be written to");
    file.to_str().expect("the target folder is UTF-8").to_owned()
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// A dozen hovers about a transmitter at the origin, with an antenna that looks 12°
/// counter-clockwise of its reported boresight; the level follows −30 dBm and an exponent of 2.5
/// but for a decibel.
fn hovers() -> String {
    let mut text = "drone,turn,time_s,east_m,north_m,heading_deg_compass,antenna_deg,rss_dbm,\
                    truth_east_m,truth_north_m\n"
        .to_owned();
    for hover in 0..12_u16 {
        let angle = f64::from(hover) * 0.55;
        let range = 8.0 + 7.0 * f64::from(hover);
        let east = range * angle.cos();
        let north = range * angle.sin();
        let towards = (-east).atan2(-north).to_degrees();
        let heading = f64::from(hover) * 30.0;
        let odd = if hover % 2 == 0 { 1.0 } else { -1.0 };
        let level = -30.0 - 25.0 * range.log10() + odd;
        for position in 0..128_u16 {
            let antenna = 2.8125 * f64::from(position);
            let off = (heading + antenna - 12.0 - towards).to_radians().cos();
            let time = 100.0 * f64::from(hover) + 0.5 * f64::from(position);
            let rss = level + 12.0 * off;
            writeln!(text, "uav1,{hover},{time},{east},{north},{heading},{antenna},{rss},0,0")
                .expect("a text takes it all");
        }
    }
    text
}

#[test]
fn a_misaligned_antenna_is_calibrated_and_corrected() {
    let folder = folder("calibration");
    let flight = write(&folder, "hovers.csv", &hovers());
    let file = folder.join("calibration.toml");
    let file = file.to_str().expect("the target folder is UTF-8");
    let report = foxhunt(["calibrate", "--json", &flight, "--out", file]).json();
    has(
        &report,
        &["p0_dbm", "exponent", "covariance", "region_95", "bearings", "stations", "skipped"],
    );
    has(&report["region_95"], &["semi_major", "semi_minor", "orientation_deg"]);
    let [low, high] = [0, 1].map(|end| number(&report["exponent_interval_95"][end]));
    assert!(low < 2.5 && 2.5 < high, "{report}");
    let offset = &report["bearings"]["offset"];
    // The boresight reported 12° to the right of the transmitter receives it best: measured minus
    // true is clockwise. Positions are 2.8° apart.
    let off = number(&offset["offset_deg_ccw"]) + 12.0;
    assert!(off.abs() <= number(&offset["half_intervals_95_deg"][0]) + 0.5, "{report}");
    // The 2 dB width overstates the error several times.
    let sigma = &report["bearings"]["sigma"];
    assert!(number(&sigma["scale"]) < 0.5 && number(&sigma["rms_ratio"]) < 0.5, "{report}");
    let table = foxhunt(["calibrate", &flight]);
    assert!(table.stdout.contains("P₀ and γ together") && table.stdout.contains("constant"));

    let first = |args: &[&str]| {
        let report = foxhunt(["bearing", "--json", &flight].iter().chain(args)).json();
        let turn = &report["turns"][0];
        (number(&turn["bearing_deg_compass"]), number(&turn["bearing_sigma_deg"]))
    };
    let (before, wide) = first(&[]);
    let (after, narrow) = first(&["--calibration", file]);
    // The first hover is East of the transmitter.
    assert_abs_diff_eq!(before, 282.0, epsilon = 3.0);
    assert_abs_diff_eq!(after, 270.0, epsilon = 3.0);
    assert!(narrow < 0.5 * wide, "{wide} {narrow}");

    // The offset is the antenna's; σ is the extractor's.
    let other = ["bearing", &flight, "--calibration", file, "--extractor", "main-lobe"];
    let warned = foxhunt(other);
    assert!(warned.code == 0 && warned.stderr.contains("σ of main-lobe stays"), "{warned:?}");

    let located = |args: &[&str]| {
        let report = foxhunt(["locate", "--json", &flight].iter().chain(args)).json();
        number(&report["error_m"])
    };
    let corrected = located(&["--calibration", file]);
    assert!(corrected < 3.0 && corrected < located(&[]), "{corrected}");
}

#[test]
fn ready_made_bearings_are_corrected_too() {
    let folder = folder("ready_made");
    let mut text =
        "east_m,north_m,bearing_deg_compass,bearing_sigma_deg,truth_east_m,truth_north_m\n"
            .to_owned();
    for i in 0..16_u16 {
        let east = 100.0 * f64::from(i % 4);
        let north = 70.0 * f64::from(i / 4);
        let towards = (130.0 - east).atan2(120.0 - north).to_degrees();
        let odd = if i % 3 == 0 { 2.0 } else { -1.0 };
        let bearing = (towards + 15.0 + odd).rem_euclid(360.0);
        writeln!(text, "{east},{north},{bearing},5,130,120").expect("a text takes it all");
    }
    let taken = write(&folder, "bearings.csv", &text);
    let file = folder.join("calibration.toml");
    let file = file.to_str().expect("the target folder is UTF-8");
    let report = foxhunt(["calibrate", "--json", &taken, "--out", file]).json();
    assert_eq!(report["calibration"]["bearings"]["extractor"], "recorded");
    assert_abs_diff_eq!(
        number(&report["bearings"]["offset"]["offset_deg_ccw"]),
        -15.0,
        epsilon = 2.0
    );
    let why = report["skipped"].as_array().expect("a list");
    // Without headings nothing is known of the compass, and without levels nothing of the power.
    for what in ["path loss", "offset over the heading"] {
        assert!(why.iter().any(|skipped| skipped["what"] == what), "{report}");
    }
    let error = |args: &[&str]| {
        let command = ["locate", "--json", &taken, "--estimator", "batch-multistart"];
        number(&foxhunt(command.iter().chain(args)).json()["error_m"])
    };
    assert!(error(&["--calibration", file]) < 5.0 && error(&[]) > 15.0);
}

#[test]
fn a_hunt_uses_what_was_calibrated() {
    let folder = folder("calibrated_hunt");
    let text = "foxhunt_calibration = 1\n[path_loss]\np0_dbm = -31.25\nexponent = 2.875\n\
                [bearings.correction]\nsigma_scale = 0.25\n";
    let file = write(&folder, "calibration.toml", text);
    let out = folder.to_str().expect("the target folder is UTF-8");
    let flown = foxhunt(["hunt", "pritzl-7.3", "--calibration", &file, "--out", out]);
    assert_eq!(flown.code, 0, "{flown:?}");
    let log = fs::read_to_string(folder.join("hunt.jsonl")).expect("it was written");
    let header: Value = serde_json::from_str(log.lines().next().expect("a header")).expect("JSON");
    assert!((number(&header["model"]["reference_dbm"]) + 31.25).abs() < 1e-12, "{header}");
    assert!(abs_diff_eq!(number(&header["model"]["exponent"]), 2.875, epsilon = 1e-12), "{header}");
    // The first bearing's σ; the places of both hunts are the same until then.
    let sigma = |log: &str| {
        let (_, after) = log.split_once("\"sigma\":").expect("a bearing");
        let number: String = after.chars().take_while(|c| !",}".contains(*c)).collect();
        number.parse::<f64>().expect("a number")
    };
    let calibrated = sigma(&log);
    assert_eq!(foxhunt(["hunt", "pritzl-7.3", "--out", out]).code, 0);
    let plain = sigma(&fs::read_to_string(folder.join("hunt.jsonl")).expect("it was written"));
    assert_abs_diff_eq!(calibrated / plain, 0.25, epsilon = 1e-9);

    let campaign = ["campaign", "pritzl-7.3", "--runs", "1", "--calibration", &file];
    assert_eq!(foxhunt(campaign).code, 0);
    let bad = write(&folder, "bad.toml", "foxhunt_calibration = 1\n[path_loss]\np0_dbm = 1\n");
    for args in [
        &["hunt"][..],
        &["campaign", "--runs", "1"],
        &["locate", "nothing.csv"],
        &["bearing", "nothing.csv"],
    ] {
        foxhunt(args.iter().chain(&["--calibration", &bad])).failed(2, &["bad.toml", "exponent"]);
    }
}

#[test]
fn a_station_has_bearings_without_further_words() {
    let file =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/uri_yagi_station/detections.csv");
    if !Path::new(file).exists() {
        println!("skipped: no recordings at {file}");
        return;
    }
    let report = foxhunt(["bearing", "--json", file]);
    assert!(report.stderr.contains("calibration: uri-yagi-station"), "{}", report.stderr);
    let turns = report.json()["turns"].as_array().expect("a list").clone();
    let bearings = turns.iter().filter(|turn| turn["bearing_deg_compass"].is_number());
    assert!(turns.len() == 1078 && bearings.count() > 900);
}

/// Bursts that two stations receive from a tag that walks around both, for two days; what is
/// recorded as 0° looks to `off` degrees on the compass, and so on clockwise.
fn bursts(offs: [f64; 2]) -> String {
    let mut text = "drone,turn,time_s,lat_deg,lon_deg,boresight_deg_compass,rss_dbm,beacon,\
                    truth_lat_deg,truth_lon_deg\n"
        .to_owned();
    for burst in 0..72_u16 {
        let around = f64::from(burst) * 2.1;
        // A degree of latitude is 111.2 km, one of longitude 71.7 km.
        let tag = (50.0 + 0.018 * around.sin(), 14.0 + 0.028 * around.cos());
        let time = 1200.0 * f64::from(burst);
        for (name, lon, off) in [("east", 14.002, offs[0]), ("west", 13.998, offs[1])] {
            let towards = (71.7 * (tag.1 - lon)).atan2(111.2 * (tag.0 - 50.0)).to_degrees();
            for recorded in [0.0, 90.0, 180.0, 270.0] {
                let away = (recorded + off - towards).to_radians().cos();
                let odd = f64::from((burst * 7 + 3) % 5) - 2.0;
                let level = -70.0 - 10.0 * (1.0 - away) + 0.3 * odd;
                let (lat, tag_lon) = tag;
                writeln!(
                    text,
                    "{name},{burst},{time},50,{lon},{recorded},{level:.1},tag,{lat:.6},{tag_lon:.6}"
                )
                .expect("a text takes it all");
            }
        }
    }
    text
}

#[test]
fn each_station_has_antennas_of_its_own() {
    let folder = folder("stations");
    let file = write(&folder, "bursts.csv", &bursts([30.0, -40.0]));
    let out = folder.join("calibration.toml");
    let out = out.to_str().expect("the target folder is UTF-8");
    let report = foxhunt(["calibrate", "--json", &file, "--out", out]).json();
    assert_eq!(report["stations"].as_array().map(Vec::len), Some(2), "{report}");
    // By name, each where it stands; boresights are off by 30° and by −40°.
    for (number, (name, lon, off)) in
        [("east", 14.002, 30.0), ("west", 13.998, -40.0)].into_iter().enumerate()
    {
        let section = &report["calibration"]["station"][number];
        assert_eq!(section["name"], name);
        assert!((self::number(&section["place"]["lon_deg"]) - lon).abs() < 1e-9, "{section}");
        for antenna in section["antennas"].as_array().expect("a list") {
            let deg = |field: &str| self::number(&antenna[field]);
            let error = deg("boresight_deg_compass") - deg("recorded_deg_compass") - off;
            let error = (error + 180.0).rem_euclid(360.0) - 180.0;
            assert!(abs_diff_eq!(error, 0.0, epsilon = 15.0), "{name}: {antenna}");
        }
    }
    // The bearings of both are then near the truth; of the other's calibration, 70° off.
    let text = fs::read_to_string(out).expect("it was written");
    let swap = text.replace("east", "x").replace("west", "east").replace("\"x\"", "\"west\"");
    let swap = swap.replace("14.002", "@").replace("13.998", "14.002").replace('@', "13.998");
    let median_error = |calibration: &str| {
        let turns = foxhunt(["bearing", "--json", &file, "--calibration", calibration]).json();
        let mut errors: Vec<f64> = turns["turns"]
            .as_array()
            .expect("a list")
            .iter()
            .filter(|turn| turn["bearing_deg_compass"].is_number())
            .map(|turn| {
                let lon = if turn["drone"] == "east" { 14.002 } else { 13.998 };
                let around = 2.1 * number(&turn["turn"]);
                let tag = (0.018 * around.sin(), 14.0 + 0.028 * around.cos());
                let towards = (71.7 * (tag.1 - lon)).atan2(111.2 * tag.0).to_degrees();
                let error = number(&turn["bearing_deg_compass"]) - towards;
                ((error + 180.0).rem_euclid(360.0) - 180.0).abs()
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        assert!(errors.len() > 72, "{}", errors.len());
        errors[errors.len() / 2]
    };
    assert!(median_error(out) < 15.0, "{}", median_error(out));
    let swapped = write(&folder, "swapped.toml", &swap);
    assert!(median_error(&swapped) > 40.0, "{}", median_error(&swapped));
}

#[test]
fn a_shipped_calibration_is_of_one_place() {
    let folder = folder("elsewhere");
    write(&folder, "station.csv", "lat_deg,lon_deg\n50,14\n");
    let mut text = "time,antenna,rssi_dbm,tag_lat_deg,tag_lon_deg\n".to_owned();
    for antenna in 1..=4 {
        writeln!(text, "2026-05-01 10:00:00,{antenna},-{}0,50.01,14", 6 + antenna)
            .expect("a text takes it all");
    }
    let file = write(&folder, "detections.csv", &text);
    let elsewhere = foxhunt(["bearing", &file, "--positions", "4"]);
    assert!(elsewhere.stderr.contains("calibration: none"), "{elsewhere:?}");
    write(&folder, "station.csv", "lat_deg,lon_deg\n41.5208,-71.5993\n");
    let text = text.replace("50.01,14", "41.53,-71.6");
    let file = write(&folder, "detections.csv", &text);
    let there = foxhunt(["bearing", &file, "--positions", "4"]);
    assert!(there.stderr.contains("as it comes with the program"), "{there:?}");
}

/// A log has the bearings of its hunt with their σ, and the truth.
#[test]
fn logs_of_hunts_are_calibrated_as_recordings_are() {
    let folder = folder("calibrated-logs");
    let out = folder.join("out").display().to_string();
    let flown = foxhunt(["hunt", "pritzl-7.4", "--estimator", "ekf", "--out", &out]);
    assert_eq!(flown.code, 0, "{flown:?}");
    let log = folder.join("out").join("hunt.jsonl").display().to_string();
    let report = foxhunt(["--json", "calibrate", &log]).json();
    let bearings = &report["bearings"];
    let counts = ["bearings", "refused"].map(|count| bearings[count].as_u64().expect("a number"));
    // Turns without a bearing are levels alone in a log.
    assert!(counts[0] > 40 && counts[0] <= 48 && counts[1] == 0, "{counts:?}");
    has(&bearings["sigma"], &["scale", "floor_deg", "correlation", "correlation_p_value"]);
    has(&report, &["p0_dbm", "exponent", "points"]);
    let printed = foxhunt(["calibrate", &log]);
    assert!(printed.stdout.contains("correlation of σ and |error|"), "{printed:?}");
    foxhunt(["calibrate", &log, "--extractor", "maximum"]).failed(2, &["already"]);
    foxhunt(["calibrate", &log, "no-such.csv"]).failed(2, &["not both"]);
}
