use approx::abs_diff_eq;
use std::{f64::consts::TAU, fs};

use crate::support::{folder, foxhunt};

/// Two seconds of an RTL-SDR's samples at 16 kS/s: noise of a counter's hash, and two pulses of
/// 20 ms, 40 dB in energy, 1 s apart, 1.5 kHz above the middle.
fn recording() -> Vec<u8> {
    samples(2, 1e4)
}

/// Samples of this many seconds, with pulses of that energy over the noise's power density.
#[expect(clippy::cast_possible_truncation, reason = "clamped to a byte")]
fn samples(seconds: u32, snr: f64) -> Vec<u8> {
    let mut state = 1_u64;
    let mut noise = || {
        // Twelve uniform numbers make a normal one.
        let mut sum = -6.0;
        for _ in 0..12 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            sum += f64::from((state >> 40) as u32) / f64::from(1 << 24);
        }
        4.0 * sum
    };
    let amplitude = 4.0 * 2_f64.sqrt() * (snr / 320.0).sqrt();
    (0..16_000 * seconds)
        .flat_map(|n| {
            let on = n % 16_000 >= 8_000 && n % 16_000 < 8_320;
            let amplitude = if on { amplitude } else { 0.0 };
            let angle = TAU * 1.5 / 16.0 * f64::from(n);
            [angle.cos(), angle.sin()]
                .map(|part| (127.5 + amplitude * part + noise()).round().clamp(0.0, 255.0) as u8)
        })
        .collect()
}

#[test]
fn pulses_of_a_file() {
    let file = folder("pulses").join("tag.cu8");
    fs::write(&file, recording()).expect("the folder can be written to");
    let file = file.to_str().expect("UTF-8");
    let options = ["--rate-hz", "16000", "--center-hz", "150e6", "--full-scale-dbm", "-20"];
    let run = |more: &[&str]| foxhunt(["pulses", file].iter().chain(&options).chain(more));
    let report = &run(&["--json"]).json()[0];
    let pulses = report["pulses"].as_array().expect("a list");
    assert_eq!(pulses.len(), 2, "{report}");
    for (pulse, time) in pulses.iter().zip([0.51, 1.51]) {
        let value = |name: &str| pulse[name].as_f64().expect("a number");
        assert!(abs_diff_eq!(value("time_s"), time, epsilon = 1e-3), "{pulse}");
        assert!(abs_diff_eq!(value("frequency_hz"), 150_001_500.0, epsilon = 2.0), "{pulse}");
        assert!(abs_diff_eq!(value("width_s"), 0.02, epsilon = 1e-3), "{pulse}");
        assert!(abs_diff_eq!(value("snr_db"), 40.0, epsilon = 0.6), "{pulse}");
        // An amplitude of 31.6 in 127.5: −12.1 dB of full scale.
        assert!(abs_diff_eq!(value("power_dbm"), -32.1, epsilon = 0.3), "{pulse}");
        assert!(value("p_value") < 1e-6, "{pulse}");
    }
    let table = run(&[]);
    assert!(table.code == 0 && table.stdout.contains("2 pulses in 2.0 s searched"), "{table:?}");
    let csv = run(&["--csv"]);
    assert!(csv.stdout.starts_with("time_s,frequency_hz,width_s,power_dbm,snr_db,"), "{csv:?}");
    assert_eq!(csv.stdout.lines().count(), 3);
    let quiet = run(&["--band-hz", "149.993e6,149.998e6"]);
    assert!(quiet.stdout.contains("nothing detected"), "{quiet:?}");
}

/// 9 dB a pulse: none by itself, and a train of them all, which `tags` takes for one tag.
#[test]
fn trains_of_a_file() {
    let folder = folder("trains");
    let file = folder.join("weak.cu8");
    fs::write(&file, samples(20, 8.0)).expect("the folder can be written to");
    let file = file.to_str().expect("UTF-8");
    let options =
        ["--rate-hz", "16000", "--center-hz", "150e6", "--band-hz", "149.998e6,150.003e6"];
    let run = |more: &[&str]| foxhunt(["pulses", file].iter().chain(&options).chain(more));
    let single = run(&["--width-ms", "20", "--false-alarms-per-hour", "0.001"]);
    assert!(single.stdout.contains("nothing detected"), "{single:?}");
    let fold = ["--fold", "8", "--interval-s", "0.97,1.04"];
    let report = &run(&[&fold[..], &["--json"]].concat()).json()[0];
    let trains = report["trains"].as_array().expect("a list");
    assert_eq!(trains.len(), 1, "{report}");
    let value = |name: &str| trains[0][name].as_f64().expect("a number");
    assert!(abs_diff_eq!(value("interval_s"), 1.0, epsilon = 1e-3), "{report}");
    assert!(abs_diff_eq!(value("frequency_hz"), 150_001_500.0, epsilon = 8.0), "{report}");
    assert!(abs_diff_eq!(value("snr_db"), 9.0, epsilon = 1.0), "{report}");
    assert!(value("pulses") >= 15.0 && value("p_value") < 1e-3, "{report}");
    let pulses = report["pulses"].as_array().expect("a list");
    assert_eq!(trains[0]["pulses"], pulses.len());
    for pulse in pulses {
        let time = pulse["time_s"].as_f64().expect("a number");
        assert!(abs_diff_eq!((time - 0.51), (time - 0.51).round(), epsilon = 0.01), "{pulse}");
        assert_eq!(pulse["train"], 0);
    }
    let table = run(&fold);
    assert!(table.stdout.contains("1 trains, ") && table.stdout.contains("interval"), "{table:?}");
    let csv = run(&[&fold[..], &["--csv"]].concat());
    assert!(csv.stdout.lines().all(|line| line.split(',').count() == 8), "{csv:?}");
    let list = folder.join("pulses.csv");
    fs::write(&list, &csv.stdout).expect("the folder can be written to");
    let tags = foxhunt(["tags", list.to_str().expect("UTF-8"), "--json"]).json();
    assert_eq!(tags["tags"].as_array().map(Vec::len), Some(1), "{tags}");
    run(&["--interval-s", "1"]).failed(2, &["--fold"]);
    run(&["--fold", "2"]).failed(2, &["weak.cu8", "pulses is 2"]);
    run(&["--fold", "5", "--interval-s", "x"]).failed(2, &["not one or two numbers"]);
}

#[test]
fn bad_samples_are_named() {
    let folder = folder("bad_pulses");
    let write = |name: &str, text: &str| {
        let file = folder.join(name);
        fs::write(&file, text).expect("the folder can be written to");
        file.to_str().expect("UTF-8").to_owned()
    };
    let raw = write("a.cu8", "0123");
    foxhunt(["pulses", &raw]).failed(2, &["a.cu8", "the sample rate is missing"]);
    foxhunt(["pulses", &raw, "--rate-hz", "0"]).failed(2, &["a.cu8", "rate is 0"]);
    let width = ["--rate-hz", "1000", "--width-ms", "2"];
    foxhunt(["pulses", &raw].iter().chain(&width)).failed(2, &["a.cu8", "widths_s is 0.002"]);
    foxhunt(["pulses", "no.cu8", "--rate-hz", "1"]).failed(2, &["no.cu8: cannot be opened"]);
    let meta = write("b.sigmf-meta", "{\"global\": {\"core:datatype\": \"ri8\"}}");
    foxhunt(["pulses", &meta]).failed(2, &["b.sigmf-meta", "core:datatype", "ri8"]);
}
