//! Recordings of other formats in our own.

use approx::abs_diff_eq;
use std::{fs, path::Path};

use crate::support::{folder, foxhunt};

#[test]
fn what_is_converted_is_located_at_the_same_place() {
    let folder = folder("convert");
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../archive/tests/data");
    for name in ["otter-telemetry/bearings.csv", "foxhunt/turns.csv"] {
        let original = data.join(name);
        let [original, out] = [original, folder.join("converted.csv")]
            .map(|path| path.to_str().expect("UTF-8").to_owned());
        let report = foxhunt(["--json", "convert", &original, &out]).json();
        assert_eq!(report["file"], out);
        let text = fs::read_to_string(&out).expect("it was written");
        assert_eq!(report["rows"].as_u64(), Some(text.lines().count() as u64 - 1));
        let place = |file: &str| {
            let located = foxhunt(["--json", "locate", file, "--every-beacon"]).json();
            let places = located.as_array().expect("a list").iter();
            let axis = |of: &serde_json::Value, axis: &str| of["estimate"][axis].as_f64();
            places
                .map(|of| [axis(of, "east_m"), axis(of, "north_m")].map(|m| m.expect("metres")))
                .collect::<Vec<_>>()
        };
        let (before, after) = (place(&original), place(&out));
        assert!(!before.is_empty() && before.len() == after.len(), "{name}");
        for (before, after) in before.iter().zip(&after) {
            // Angles come back to rounding.
            let off = (before[0] - after[0]).hypot(before[1] - after[1]);
            assert!(off < 0.01, "{name}: {before:?}, {after:?}");
        }
        foxhunt(["convert", &original, &original]).failed(2, &["written over"]);
        foxhunt(["convert", &original, &out, "--rssi-topic", "/rssi"]).failed(2, &["bags"]);
        foxhunt(["convert", &original, "/no/such/x.csv"]).failed(1, &["/no/such/x.csv"]);
    }
    let no_bag = folder.join("broken.mcap");
    fs::write(&no_bag, b"\x89MCAP0\r\nand nothing more").expect("a file");
    let no_bag = no_bag.to_str().expect("UTF-8");
    let out = folder.join("bag.csv");
    foxhunt(["convert", no_bag, out.to_str().expect("UTF-8")]).failed(2, &["broken.mcap", "bag"]);
    foxhunt(["convert", no_bag]).failed(2, &["2 values"]);
}

#[test]
fn attitudes_are_kept() {
    let folder = folder("convert-attitude");
    let path = |name: &str| folder.join(name).to_str().expect("UTF-8").to_owned();
    let [tilted, out] = ["tilted.csv", "out.csv"].map(path);
    let header = "time_s,east_m,north_m,heading_deg_compass,pitch_deg,roll_deg,\
                  boresight_deg_compass,rss_dbm";
    let rows = "0,0,0,90,-5.5,12.25,0,-60\n1,0,0,90,0,0,90,-61\n";
    fs::write(&tilted, format!("{header}\n{rows}")).expect("a file");
    assert_eq!(foxhunt(["--json", "convert", &tilted, &out]).json()["rows"], 2);
    let text = fs::read_to_string(&out).expect("it was written");
    let mut table = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = table.next().expect("a header");
    let of = |row: &[&str], name: &str| {
        let column = names.iter().position(|known| *known == name).expect(name);
        row[column].parse::<f64>().unwrap_or(0.0)
    };
    let attitudes: Vec<_> =
        table.map(|row| [of(&row, "pitch_deg"), of(&row, "roll_deg")]).collect();
    let close = |a: f64, b: f64| abs_diff_eq!(a, b, epsilon = 1e-12);
    assert!(close(attitudes[0][0], -5.5) && close(attitudes[0][1], 12.25), "{attitudes:?}");
    assert!(close(attitudes[1][0], 0.0) && close(attitudes[1][1], 0.0), "{attitudes:?}");
}

/// Pulses whose clock is 2.3 s behind that of an antenna that turns unevenly, heard at one place.
#[test]
fn pulses_are_joined_with_poses_of_another_clock() {
    let folder = folder("convert-poses");
    let path = |name: &str| folder.join(name).to_str().expect("UTF-8").to_owned();
    let [pulses, poses, out] = ["pulses.csv", "poses.csv", "joined.csv"].map(path);
    let boresight = |time: f64| (24.0 * time + 70.0 * (0.31 * time).sin()).rem_euclid(360.0);
    let mut text = "time_utc,east_m,north_m,boresight_deg_compass\n".to_owned();
    for i in 0..1200 {
        let time = 0.1 * f64::from(i);
        let utc = format!("10:{:02}:{:04.1}", i / 600, time % 60.0);
        text += &format!("2026-11-24 {utc},0,0,{}\n", boresight(time));
    }
    fs::write(&poses, &text).expect("a file");
    let mut text = "time_s,frequency_hz,width_s,power_dbm,snr_db,tags\n".to_owned();
    for i in 0..80 {
        let time = 6.0 + 1.3 * f64::from(i);
        let off = (boresight(time) - 77.0).to_radians();
        // 1 dB one way and the other.
        let noise = f64::from(i * i * 7 % 21) / 10.0 - 1.0;
        let level = 7.0 * off.cos() + 2.0 * (2.0 * off).cos() + noise - 60.0;
        let tag = if i == 40 { "" } else { "fox" };
        text += &format!("{},150e6,0.02,{level},25,{tag}\n", time - 2.3);
    }
    fs::write(&pulses, &text).expect("a file");
    let args = |offset: &'static str, more: &[&'static str]| {
        let all = ["--json", "convert", &pulses, &out, "--poses", &poses, "--clock-offset", offset];
        all.iter().map(ToString::to_string).chain(more.iter().map(ToString::to_string)).collect()
    };
    let begin = "2026-11-24T10:00:00Z";
    let run = |args: Vec<String>| foxhunt(args);
    let found = run(args(begin, &["--clock-within-s", "4"])).json();
    let seconds = |value: &serde_json::Value| value.as_f64().expect("seconds") - 1_795_514_400.0;
    let interval = [0, 1].map(|end| seconds(&found["clock_interval_s"][end]));
    assert!(interval[0] < 2.3 && 2.3 < interval[1] && interval[1] - interval[0] < 1.0);
    assert_eq!([&found["rows"], &found["of_no_tag"]], [79, 1]);
    let bearings = ["--json", "bearing", &out, "--extractor", "first-harmonic-db"];
    let bearings = foxhunt(bearings).json();
    let first = bearings["turns"][0]["bearing_deg_compass"].as_f64().expect("a bearing");
    assert!(abs_diff_eq!(first, 77.0, epsilon = 20.0), "{bearings}");
    let earlier = fs::read(&out).expect("what was written");
    // Neither the true offset in the range nor a pose at all.
    run(args(begin, &["--clock-within-s", "1"])).failed(2, &["pulses.csv", "poses.csv", "end"]);
    run(args("1e3", &[])).failed(2, &["none of 80", "--clock-offset"]);
    run(args("noon", &[])).failed(2, &["UTC"]);
    run(args(begin, &["--clock-within-s", "-1"])).failed(2, &["-1"]);
    assert_eq!(fs::read(&out).expect("it is there"), earlier);
}
