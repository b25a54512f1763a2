use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::{fmt::Write as _, fs};

use crate::support::{folder, foxhunt, has};

#[test]
fn the_figures_of_an_antenna() {
    let read = foxhunt(["antenna", "reference-patch", "--json"]).json();
    has(
        &read,
        &[
            "antenna",
            "gain_dbi",
            "main_lobe_azimuth_deg",
            "main_lobe_elevation_deg",
            "azimuth_beamwidth_deg",
            "elevation_beamwidth_deg",
            "front_to_back_db",
            "directivity_dbi",
            "electrical_tilt_deg",
            "header",
        ],
    );
    assert_abs_diff_eq!(
        read["azimuth_beamwidth_deg"].as_f64().expect("a number"),
        70.1,
        epsilon = 0.1
    );
    assert_abs_diff_eq!(read["front_to_back_db"].as_f64().expect("a number"), 17.0, epsilon = 0.1);
    assert!(read["elevation_beamwidth_deg"].is_null(), "the same at every elevation");
    let table = foxhunt(["antenna", "dipole"]);
    assert!(table.stdout.contains("78.1") && table.stdout.contains("2.15"), "{table:?}");
}

#[test]
fn an_antenna_is_written_and_read_again() {
    let folder = folder("antenna");
    let path = |name: &str| folder.join(name).display().to_string();
    let msi = path("a.msi");
    let pln = path("b.pln");
    let csv = path("c.csv");
    let svg = path("a.svg");
    let first = foxhunt(["antenna", "yagi", "--write", &msi, "--out", &svg, "--json"]).json();
    let again = foxhunt(["antenna", &msi, "--write", &pln, "--json"]).json();
    for field in ["gain_dbi", "azimuth_beamwidth_deg", "elevation_beamwidth_deg"] {
        let [a, b] = [&first, &again].map(|r| r[field].as_f64().expect("a number"));
        assert!(abs_diff_eq!(a, b, epsilon = 0.1), "{field}: {a} and {b}");
    }
    assert_eq!(again["header"]["NAME"], "yagi");
    assert_eq!(fs::read(&msi).expect("written"), fs::read(&pln).expect("written"));
    assert_eq!(foxhunt(["antenna", &msi, "--write", &csv]).code, 0);
    let flat = foxhunt(["antenna", &csv, "--json"]).json();
    let [a, b] = [&first, &flat].map(|r| r["azimuth_beamwidth_deg"].as_f64().expect("a number"));
    assert_abs_diff_eq!(a, b, epsilon = 0.1);
    let picture = fs::read_to_string(&svg).expect("written");
    assert!(picture.starts_with("<svg") && picture.contains("yagi"), "{picture}");
}

#[test]
fn what_is_no_antenna_is_wrong_input() {
    foxhunt(["antenna", "horn"]).failed(2, &["horn", "reference-patch"]);
    foxhunt(["antenna", "no-such.msi"]).failed(2, &["no-such.msi"]);
    foxhunt(["antenna", "dipole", "--write", "dipole.txt"]).failed(2, &["dipole.txt", ".msi"]);
    let folder = folder("broken-antenna");
    let broken = folder.join("broken.msi").display().to_string();
    fs::write(&broken, "NAME x\nGAIN 3\n").expect("a file");
    foxhunt(["antenna", &broken]).failed(2, &["broken.msi", "line 2", "unit"]);
}

/// A lobe of 15 dB that looks to 120° compass, received twice from places 30 dB apart in level.
#[test]
fn a_pattern_is_learned_from_turns_with_a_known_bearing() {
    let folder = folder("learned-antenna");
    let path = |name: &str| folder.join(name).display().to_string();
    let header =
        "drone,turn,time_s,east_m,north_m,boresight_deg_compass,rss_dbm,truth_east_m,truth_north_m";
    let mut text = format!("{header}\n");
    for turn in 0..2 {
        for position in 0..128 {
            let boresight = 2.8125 * f64::from(position);
            let off = (boresight - 120.0).to_radians().cos();
            let rss = -60.0 - 30.0 * f64::from(turn) + 7.5 * off;
            let time = 128 * turn + position;
            // 120° compass: East by the sine, North by the cosine.
            writeln!(text, "uav1,{turn},{time},0,0,{boresight},{rss},86.60254,-50")
                .expect("a text");
        }
    }
    let file = path("turns.csv");
    fs::write(&file, text).expect("the folder can be written to");
    let csv = path("learned.csv");
    let learned = foxhunt(["antenna", "--learn", &file, "--write", &csv, "--json"]).json();
    assert_eq!(learned["learned"]["directions"], 256);
    assert_eq!(learned["learned"]["harmonics"], 1);
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    assert_abs_diff_eq!(number(&learned["gain_dbi"]), 7.5, epsilon = 1e-6);
    assert_abs_diff_eq!(number(&learned["front_to_back_db"]), 15.0, epsilon = 1e-6);
    assert_abs_diff_eq!(number(&learned["main_lobe_azimuth_deg"]), 0.0, epsilon = 0.1);
    let again = foxhunt(["antenna", &csv, "--json"]).json();
    let widths = [&learned, &again].map(|r| number(&r["azimuth_beamwidth_deg"]));
    assert_abs_diff_eq!(widths[0], widths[1], epsilon = 1e-6);
    // Taken for 90° further to the right, the strongest direction is on the right.
    let turned = foxhunt(["antenna", "--learn", &file, "--bearing-deg", "210", "--json"]).json();
    let lobe = number(&turned["main_lobe_azimuth_deg"]);
    assert_abs_diff_eq!(lobe, -90.0, epsilon = 0.1);
    foxhunt(["antenna", "--learn", &file, "--truth", "50,14"]).failed(2, &["--truth"]);
    let text = fs::read_to_string(&file).expect("it was written");
    let few: Vec<&str> = text.lines().take(11).collect();
    fs::write(&file, few.join("\n")).expect("as before");
    foxhunt(["antenna", "--learn", &file]).failed(2, &["turns.csv", "10 directions"]);
    foxhunt(["antenna"]).failed(2, &["FILE|NAME"]);
}
