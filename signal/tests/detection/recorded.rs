//! Keyed transmitters that were recorded.

use std::{ops::Range, path::PathBuf};

use foxhunt_signal::{
    detector::{Detection, Detector, DetectorConfig},
    samples::{OpenOptions, open},
};
use rustfft::num_complex::Complex32;

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/pulses");

/// All pulses of a recording at a nominal rate; `None` where there is no recording.
fn found(name: &str, rate_hz: f64, widths_s: &[f64]) -> Option<Vec<Detection>> {
    let path = PathBuf::from(DATA).join(name);
    if !path.exists() {
        println!("skipped: no recordings at {DATA}");
        return None;
    }
    let mut options = OpenOptions::default();
    options.rate_hz = Some(rate_hz);
    let mut source = open(&path, &options).expect("it is there");
    let mut config = DetectorConfig::new(rate_hz);
    config.widths_s = widths_s.to_vec();
    config.least_noise = source.rounding_noise();
    let mut detector = Detector::new(config).expect("it is in order");
    let mut chunk = Vec::new();
    let mut found = Vec::new();
    while let Some(first) = source.read(&mut chunk).expect("it can be read") {
        detector.push(first, &chunk, &mut found).expect("in order");
    }
    detector.finish(&mut found);
    Some(found)
}

/// The stretches, in seconds of the nominal rate, in which the power over 100 samples is above a
/// threshold of full scale.
fn on_air(name: &str, rate_hz: f64, threshold: f32) -> Vec<Range<f64>> {
    let mut options = OpenOptions::default();
    options.rate_hz = Some(rate_hz);
    let mut source = open(&PathBuf::from(DATA).join(name), &options).expect("it is there");
    let mut chunk = Vec::new();
    let mut samples = Vec::new();
    while source.read(&mut chunk).expect("it can be read").is_some() {
        samples.append(&mut chunk);
    }
    let power = |some: &[Complex32]| some.iter().map(Complex32::norm_sqr).sum::<f32>() / 100.0;
    let mut stretches: Vec<Range<f64>> = Vec::new();
    let mut was = false;
    for (n, some) in samples.chunks_exact(100).enumerate() {
        let on = power(some) > threshold;
        let start = (n * 100) as f64 / rate_hz;
        let end = ((n + 1) * 100) as f64 / rate_hz;
        match stretches.last_mut() {
            Some(last) if on && was => last.end = end,
            _ if on => stretches.push(start..end),
            _ => {}
        }
        was = on;
    }
    stretches
}

/// Every stretch has a strong detection inside it, and none is while nothing is on air, but at the
/// centre: there is a line of the receiver itself, which transmitters that are on air hide.
fn compare(found: &[Detection], on_air: &[Range<f64>]) {
    for on in on_air {
        let inside = found.iter().filter(|found| on.contains(&found.pulse.time_s));
        let strongest = inside.max_by(|a, b| a.pulse.snr_db.total_cmp(&b.pulse.snr_db));
        let pulse = strongest.unwrap_or_else(|| panic!("nothing at {on:?}")).pulse;
        assert!(pulse.snr_db > 30.0, "{pulse:?} in {on:?}");
    }
    for found in found.iter().filter(|found| found.pulse.frequency_hz.abs() > 100.0) {
        let middle = found.pulse.time_s;
        let half = found.pulse.width_s / 2.0;
        let overlaps = |on: &Range<f64>| middle + half > on.start && middle - half < on.end;
        assert!(on_air.iter().any(overlaps), "{found:?}");
    }
}

/// Keyed on and off, 17 dB above the noise in a sample: 108 pulses of 500 or 1,500 samples in
/// symbols of 1,991. At a nominal rate at which they last 10 and 30 ms. Their carriers wander by
/// many times the inverse length, so that there are several detections in each.
#[test]
fn every_pulse_of_a_keyed_transmitter() {
    let name = "urh_ook_overshoot.cs8";
    let Some(found) = found(name, 5e4, &[2.5e-3, 5e-3, 10e-3, 20e-3, 40e-3]) else { return };
    let on_air = on_air(name, 5e4, 0.25);
    assert_eq!(on_air.len(), 108);
    compare(&found, &on_air);
}

/// Keyed in frequency, the recording muted between its three bursts of 33,700 samples, one each
/// 38,678: lines in each, and none between.
#[test]
fn every_burst_of_a_keyed_transmitter() {
    let name = "urh_esaver.cs8";
    let Some(found) = found(name, 1e6, &[10e-3, 33.7e-3]) else { return };
    let on_air = on_air(name, 1e6, 0.1);
    assert_eq!(on_air.len(), 3);
    compare(&found, &on_air);
}
