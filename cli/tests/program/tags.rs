//! `tags`: pulses assigned to tags.

use approx::assert_abs_diff_eq;
use std::fmt::Write as _;

use crate::support::{folder, foxhunt, has};

/// Pulses each 1.3 s of one tag, and a few of noise.
fn pulses() -> String {
    let mut text = "time_s,frequency_hz,width_s,power_dbm,snr_db\n".to_owned();
    for pulse in 0..60_u32 {
        let time = 1.3 * f64::from(pulse);
        let ripple = f64::from(pulse * 7 % 5);
        writeln!(text, "{time},{},0.02,-80,20", 150_000_000.0 + 3.0 * ripple).expect("it fits");
        if pulse % 9 == 4 {
            let noise = time + 0.37 + 0.05 * ripple;
            writeln!(text, "{noise},{},0.004,-95,13", 150_000_400.0 + 90.0 * ripple)
                .expect("it fits");
        }
    }
    text
}

fn write(name: &str, file: &str, text: &str) -> String {
    let path = folder(name).join(file);
    std::fs::write(&path, text).expect("a file can be written");
    path.to_string_lossy().into_owned()
}

#[test]
fn tags_of_a_list() {
    let list = write("tags_list", "pulses.csv", &pulses());
    let report = foxhunt(["tags", "--json", &list]).json();
    has(&report, &["file", "format", "pulses", "tags", "others"]);
    let tags = report["tags"].as_array().expect("a list");
    assert_eq!(tags.len(), 1, "{report}");
    assert_eq!(tags[0]["pulses"].as_array().map(Vec::len), Some(60), "{report}");
    let interval = tags[0]["interval_s"].as_f64().expect("a number");
    assert_abs_diff_eq!(interval, 1.3, epsilon = 1e-6);
    assert!(foxhunt(["tags", &list]).stdout.contains("unknown 1"));

    let table = write("tags_table", "tags.csv", "name,interval_s,frequency_hz\nfox,1.3,150e6\n");
    let given = foxhunt(["tags", &list, "--tags", &table, "--csv"]).stdout;
    assert_eq!(given.lines().filter(|line| line.ends_with("\"fox\"")).count(), 60, "{given}");
}

#[test]
fn bad_lists_are_refused_with_line_and_value() {
    let head = "time_s,frequency_hz,width_s,power_dbm,snr_db\n";
    let bad = write("tags_bad", "bad.csv", &format!("{head}0,1,wide,-80,20\n"));
    foxhunt(["tags", &bad]).failed(2, &["bad.csv", "line 2", "width_s", "wide"]);
    let list = write("tags_good", "pulses.csv", &pulses());
    foxhunt(["tags", &list, "--intervals-s", "5,2"]).failed(2, &["intervals_s", "2"]);
}
