//! Rows that cannot be believed, and tables as people have them, as the program takes them.

use std::{
    fs,
    io::Write as _,
    process::{Command, Stdio},
};

use serde_json::Value;

use crate::support::{data, folder, foxhunt};

fn place(report: &Value) -> [f64; 2] {
    ["east_m", "north_m"].map(|axis| report["estimate"][axis].as_f64().expect("metres"))
}

fn codes(report: &Value) -> Vec<&str> {
    let remarks = report["remarks"].as_array().expect("a list").iter();
    remarks.map(|remark| remark["code"].as_str().expect("a text")).collect()
}

/// A walk of 90 levels about a transmitter at (40, 30), each line changed by its number.
fn walk(change: impl Fn(usize, String) -> String) -> String {
    let mut text = change(1, "time_s,east_m,north_m,rss_dbm,truth_east_m,truth_north_m".to_owned());
    for second in 0..90_u8 {
        let lane = f64::from(second / 30);
        let east = 3.0 * f64::from(second % 30);
        let north = 25.0 * lane;
        let fading = f64::from(u16::from(second) * 37 % 11) / 5.0 - 1.0;
        let range = (east - 40.0).hypot(north - 30.0).hypot(2.0);
        let level = -30.0 - 25.0 * range.log10() + fading;
        let row = format!("{},{east},{north},{level:.2},40,30", 3 * u16::from(second));
        text += &format!("\n{}", change(usize::from(second) + 2, row));
    }
    text + "\n"
}

#[test]
fn bad_rows_are_named_by_every_command_and_change_nothing() {
    let folder = folder("rows");
    let write = |name: &str, text: &str| {
        let file = folder.join(name);
        fs::write(&file, text).expect("a file");
        file.to_str().expect("UTF-8").to_owned()
    };
    let bad = [(9, "24,loud,0,-50,40,30"), (20, "57,90000,0,-20,40,30"), (50, "x"), (91, "")];
    let row = |line: usize, row: String| {
        bad.iter().find(|(at, _)| *at == line).map_or(row, |(_, bad)| (*bad).to_owned())
    };
    let whole = write("whole.csv", &walk(|_, row| row));
    let file = write("bad.csv", &walk(row));
    let good =
        walk(|line, text| if row(line, text.clone()) == text { text } else { String::new() });
    let good = write("good.csv", &good);
    let expected = foxhunt(["--json", "locate", &good]).json();
    assert_eq!(codes(&expected), [""; 0]);
    let ran = foxhunt(["--json", "locate", &file]);
    let report = ran.json();
    assert_eq!(codes(&report), ["rows-left-out", "position-jumps"]);
    assert_eq!(report["estimate"], expected["estimate"]);
    for part in ["warning: ", "line 9, east_m: \"loud\"", "line 20, east_m, north_m", "line 50"] {
        assert!(ran.stderr.contains(part), "{part}: {}", ran.stderr);
    }
    assert!(report["error_m"].as_f64().is_some_and(|off| off < 10.0), "{report}");
    let out = folder.join("out.csv");
    let out = out.to_str().expect("UTF-8");
    for args in [vec!["convert", &file, out], vec!["judge", &file], vec!["calibrate", &file]] {
        let ran = foxhunt(&args);
        assert_eq!(ran.code, 0, "{ran:?}");
        assert!(ran.stderr.contains("(rows-left-out)"), "{ran:?}");
        let strict = args.iter().chain(&["--strict"]);
        foxhunt(strict).failed(2, &["bad.csv, line 9, east_m: \"loud\" is not a number"]);
    }
    assert_eq!(foxhunt(["locate", &whole, "--strict"]).code, 0);
    let mostly = write(
        "most.csv",
        &walk(|line, row| if line > 1 && line < 60 { "x,y".to_owned() } else { row }),
    );
    foxhunt(["locate", &mostly]).failed(2, &["most.csv, line 2", "58 of 90 rows"]);
}

#[test]
fn a_drive_without_a_fix_or_with_a_clock_that_was_set_is_located() {
    let folder = folder("drives");
    let drive = fs::read_to_string(data("krakensdr-drive.csv")).expect("a drive");
    let changed = |name: &str, change: &dyn Fn(usize, &mut Vec<String>)| {
        let line = |(index, line): (usize, &str)| {
            let mut cells: Vec<String> = line.split(", ").map(str::to_owned).collect();
            change(index + 1, &mut cells);
            cells.join(", ") + "\n"
        };
        let text: String = drive.lines().enumerate().map(line).collect();
        let file = folder.join(name);
        fs::write(&file, text).expect("a file");
        let file = file.to_str().expect("UTF-8");
        foxhunt(["--json", "locate", file, "--format", "krakensdr"]).json()
    };
    let degrees = |report: &Value| {
        ["lat_deg", "lon_deg"].map(|axis| report["estimate"][axis].as_f64().expect("degrees"))
    };
    let good = changed("good.csv", &|_, _| ());
    let no_fix = changed("nofix.csv", &|line, cells| {
        if [21, 22].contains(&line) {
            cells.splice(8..10, ["0.0", "0.0"].map(str::to_owned));
        }
    });
    let back = changed("back.csv", &|line, cells| {
        if line > 25 {
            let time: i64 = cells[0].parse().expect("a time");
            cells[0] = (time - 3_600_000).to_string();
        }
    });
    assert_eq!(codes(&good), [""; 0]);
    assert_eq!((codes(&no_fix), codes(&back)), (vec!["no-position"], vec!["clock-runs-back"]));
    for (report, within_m) in [(no_fix, 10.0), (back, 60.0)] {
        let [place, other] = [degrees(&good), degrees(&report)];
        let off = (111e3 * (place[0] - other[0])).hypot(89e3 * (place[1] - other[1]));
        assert!(off < within_m, "{off} m: {report}");
    }
}

#[test]
fn tables_of_people_are_located() {
    let mapping = data("tables/wigle.toml");
    let wigle = data("tables/wigle.csv");
    let args = ["--json", "locate", &wigle, "--format", &mapping, "--beacon", "aa:bb:cc:00:00:01"];
    let report = foxhunt(args).json();
    assert_eq!(codes(&report), ["position-jumps", "preamble"]);
    // Some 160 m from the first fix; with the two that jump it is 870 m off.
    let [east, north] = place(&report);
    assert!((100.0..250.0).contains(&east.hypot(north)), "{report}");

    let comma = foxhunt(["--json", "locate", &data("tables/decimal-comma.csv")]).json();
    assert_eq!(codes(&comma), [""; 0]);
    let positive = data("tables/positive-rssi.csv");
    let taken = foxhunt(["--json", "locate", &positive]).json();
    assert_eq!(codes(&taken), ["positive-levels", "range-open"]);
    let mended = foxhunt(["--json", "locate", &positive, "--negate-levels"]).json();
    assert_eq!(codes(&mended), [""; 0]);
    let off = [0, 1].map(|axis| place(&mended)[axis] - place(&comma)[axis]);
    assert!(off[0].hypot(off[1]) < 30.0, "it is the same walk: {mended}, {comma}");
    // A column of attenuation is added to the level.
    let attenuated = foxhunt(["--json", "locate", &data("tables/attenuator.csv")]).json();
    assert!(attenuated["error_m"].as_f64().is_some_and(|off| off < 8.0), "{attenuated}");
}

#[test]
fn a_table_comes_from_standard_input() {
    let text = walk(|line, row| match line {
        1 => "time,x,y,rssi,truth_east_m,truth_north_m".to_owned(),
        _ => row,
    });
    let mut child = Command::new(env!("CARGO_BIN_EXE_foxhunt"))
        .args(["--json", "locate", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program was built for this test");
    let mut stdin = child.stdin.take().expect("a pipe");
    stdin.write_all(text.as_bytes()).expect("it reads");
    drop(stdin);
    let ran = child.wait_with_output().expect("it ends");
    let report: Value = serde_json::from_slice(&ran.stdout).expect("JSON");
    assert_eq!(codes(&report), ["columns-by-name"]);
    assert!(report["error_m"].as_f64().is_some_and(|off| off < 10.0), "{report}");
}
