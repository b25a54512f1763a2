use approx::abs_diff_eq;
use std::{
    fs,
    io::{BufRead, BufReader},
    process::{Command, Stdio},
};

use serde_json::Value;

use crate::support::{folder, foxhunt};

/// Fifteen seconds of the samples under a simulated drone, and what was sent, by the columns time
/// and frequency.
fn recording(name: &str) -> (String, Vec<[f64; 2]>) {
    let folder = folder(name);
    let file = folder.join("tag.sigmf-meta").to_str().expect("UTF-8").to_owned();
    let truth = folder.join("truth.csv").to_str().expect("UTF-8").to_owned();
    let emulate = ["--json", "emulate", "rtl-tcp", "--scenario", "vhf-tag", "--for", "15"];
    let written = foxhunt(emulate.iter().chain(&["--to", &file, "--pulses", &truth])).json();
    assert_eq!(written["samples"], 15 * 250_000, "{written}");
    let text = fs::read_to_string(truth).expect("it was written");
    let number = |row: &str, column: usize| -> f64 {
        row.split(',').nth(column).expect("a column").parse().expect("a number")
    };
    let sent = text.lines().skip(1).map(|row| [number(row, 0), number(row, 1)]).collect();
    (file, sent)
}

#[test]
fn a_recording_gives_its_tags() {
    let (file, sent) = recording("listen");
    let table = folder("listen-tags").join("tags.csv");
    fs::write(&table, "name,frequency_hz,interval_s,width_s\nfox,150100000,1.3,0.02\n")
        .expect("the folder can be written to");
    let table = table.to_str().expect("UTF-8");
    let level = ["--full-scale-dbm", "-28"];
    let report = foxhunt(["--json", "listen", &file, "--tags", table].iter().chain(&level)).json();
    let [tag] = report["tags"].as_array().expect("a list").as_slice() else { panic!("{report}") };
    assert_eq!((tag["name"].as_str(), tag["known"].as_bool()), (Some("fox"), Some(true)));
    assert_eq!(tag["pulses"].as_u64(), Some(sent.len() as u64), "{tag}");
    let value = |field: &str| tag[field].as_f64().expect("a number");
    assert!(abs_diff_eq!(value("interval_s"), 1.3, epsilon = 0.01), "{tag}");
    assert!(abs_diff_eq!(value("frequency_hz"), 150.1e6, epsilon = 10.0), "{tag}");
    let pulses = report["pulses"].as_array().expect("a list");
    let of = |pulse: &Value, field: &str| pulse[field].as_f64().expect("a number");
    for (pulse, [time, frequency]) in pulses.iter().zip(&sent) {
        assert!(abs_diff_eq!(of(pulse, "time_s"), time, epsilon = 2e-3), "{pulse} at {time}");
        assert!(abs_diff_eq!(of(pulse, "frequency_hz"), frequency, epsilon = 15.0), "{pulse}");
    }
    // As CSV each pulse is the line that `foxhunt pulses` prints, and `foxhunt tags` reads it.
    let list = foxhunt(["listen", &file, "--csv"].iter().chain(&level));
    assert_eq!(list.stdout.lines().count(), 1 + sent.len(), "{}", list.stdout);
    assert_eq!(list.stdout, foxhunt(["pulses", &file, "--csv"].iter().chain(&level)).stdout);
    // Where no terminal is connected: a line for each pulse, then the tags.
    let lines = foxhunt(["listen", &file, "--for-s", "6"]);
    assert!(lines.stdout.contains("dBFS") && lines.stdout.contains("E/N0 dB"), "{lines:?}");
    assert!(lines.stdout.contains("0 samples lost in 0 gaps"), "{lines:?}");
}

#[test]
fn what_cannot_be_listened_to_is_refused() {
    let (file, _) = recording("listen-refused");
    foxhunt(["listen", &file, "--gain-db", "20"]).failed(2, &["--gain-db", "tcp: and soapy:"]);
    foxhunt(["listen", &file, "--rate-hz", "1e6"]).failed(2, &["tag.sigmf"]);
    foxhunt(["listen", "tcp:127.0.0.1:1", "--rate-hz", "250000"]).failed(2, &["--center-hz"]);
    let nobody = ["tcp:127.0.0.1:1", "--rate-hz", "250000", "--center-hz", "150e6"];
    foxhunt(["listen"].iter().chain(&nobody)).failed(1, &["127.0.0.1:1"]);
    if !cfg!(feature = "soapy") {
        let none = ["soapy:driver=none", "--rate-hz", "250000", "--center-hz", "150e6"];
        foxhunt(["listen"].iter().chain(&none)).failed(2, &["soapy:driver=none", "feature soapy"]);
    }
    foxhunt(["emulate", "rtl-tcp", "--to", "x.wav", "--for", "1"]).failed(2, &["x.wav"]);
    foxhunt(["emulate", "rtl-tcp", "--speed", "2"]).failed(2, &["--speed"]);
}

/// The program listens to the program. How much is sent in five seconds of a busy computer is not
/// known, so only what comes is held against what was sent.
#[test]
fn a_server_of_rtl_tcp_is_listened_to() {
    let truth = folder("listen-live").join("truth.csv");
    let mut server = Command::new(env!("CARGO_BIN_EXE_foxhunt"))
        .args(["emulate", "rtl-tcp", "--scenario", "vhf-tag", "--listen", "127.0.0.1:0"])
        .args(["--for", "60", "--pulses"])
        .arg(&truth)
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program was built for this test");
    let mut line = String::new();
    let stdout = server.stdout.take().expect("it is piped");
    BufReader::new(stdout).read_line(&mut line).expect("it prints where it listens");
    let endpoint = line.trim().trim_start_matches("rtl-tcp: ").to_owned();
    let settings = ["--center-hz", "150.08e6", "--rate-hz", "250000", "--full-scale-dbm", "-28"];
    let more = ["--for-s", "8", "--width-ms", "20"];
    let ran = foxhunt(["--json", "listen", &endpoint].iter().chain(&settings).chain(&more));
    server.kill().expect("it runs");
    server.wait().expect("it was killed");
    let report = ran.json();
    let pulses = report["pulses"].as_array().expect("a list");
    assert!(!pulses.is_empty(), "{report}");
    let text = fs::read_to_string(truth).expect("it was written");
    let levels: Vec<f64> = text
        .lines()
        .skip(1)
        .map(|row| row.split(',').nth(3).expect("a column").parse().expect("a number"))
        .collect();
    for pulse in pulses {
        let frequency = pulse["frequency_hz"].as_f64().expect("a number");
        assert!(abs_diff_eq!(frequency, 150.1e6, epsilon = 15.0), "{pulse}");
        let level = pulse["power_dbm"].as_f64().expect("a number");
        assert!(levels.iter().any(|sent| (sent - level).abs() < 2.0), "{level}, {levels:?}");
    }
}
