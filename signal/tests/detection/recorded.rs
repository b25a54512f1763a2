//! Keyed transmitters that were recorded.

use std::path::PathBuf;

use foxhunt_signal::{
    detector::{Detection, Detector, DetectorConfig},
    samples::{OpenOptions, open},
};

/// All pulses of a recording at a nominal rate; `None` where there is no recording.
fn found(name: &str, rate_hz: f64, widths_s: &[f64]) -> Option<Vec<Detection>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/pulses");
    let path = PathBuf::from(folder).join(name);
    if !path.exists() {
        println!("skipped: no recordings at {folder}");
        return None;
    }
    let mut options = OpenOptions::default();
    options.rate_hz = Some(rate_hz);
    let mut source = open(&path, &options).expect("it is there");
    let mut config = DetectorConfig::new(rate_hz);
    config.widths_s = widths_s.to_vec();
    let mut detector = Detector::new(config).expect("it is in order");
    let (mut chunk, mut found) = (Vec::new(), Vec::new());
    while let Some(first) = source.read(&mut chunk).expect("it can be read") {
        detector.push(first, &chunk, &mut found).expect("in order");
    }
    detector.finish(&mut found);
    Some(found)
}

#[test]
fn every_pulse_of_a_keyed_transmitter() {
    // 1,991 samples a pulse.
    let Some(found) = found("urh_ook_overshoot.cs8", 1e5, &[20e-3]) else { return };
    for found in &found {
        println!("{:?}", found.pulse);
    }
    println!("{}", found.len());
}

#[test]
fn every_burst_of_a_keyed_transmitter() {
    // 38,678 samples a burst.
    let Some(found) = found("urh_esaver.cs8", 1e6, &[38.7e-3]) else { return };
    for found in &found {
        println!("{:?}", found.pulse);
    }
    println!("{}", found.len());
}
