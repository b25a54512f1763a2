//! Strong and weak pulses together, clicks, carriers, gaps.

use approx::assert_abs_diff_eq;
use std::f64::consts::TAU;

use foxhunt_signal::detector::{Detection, Detector, DetectorConfig};
use rustfft::num_complex::Complex32;

use super::air::{Air, Sent, detect};

const RATE_HZ: f64 = 48e3;

fn pulse(time_s: f64, frequency_hz: f64, snr_db: f64) -> Sent {
    Sent { time_s, frequency_hz, width_s: 20e-3, snr_db }
}

fn is(sent: &Sent, found: &Detection) -> bool {
    (found.pulse.time_s - sent.time_s).abs() < 3e-3
        && (found.pulse.frequency_hz - sent.frequency_hz).abs() < 30.0
}

/// The pulses that were sent and not found, and the pulses that were found and not sent.
fn compare(sent: &[Sent], found: &[Detection]) -> (Vec<Sent>, Vec<Detection>) {
    let missed = |s: &&Sent| !found.iter().any(|found| is(s, found));
    let wrong = |f: &&Detection| !sent.iter().any(|sent| is(sent, f));
    (sent.iter().filter(missed).copied().collect(), found.iter().filter(wrong).copied().collect())
}

/// 60 dB beside 20 dB: 4 kHz away at once, at the same frequency 30 ms later, and in between.
#[test]
fn strong_pulses_hide_no_weak_ones_and_leave_no_ghosts() {
    let mut air = Air::new(RATE_HZ, 3);
    let mut samples = air.noise(480_000);
    let mut sent = Vec::new();
    for n in 0..9 {
        let at = 0.5 + f64::from(n);
        let more = [(at, 0.0, 60.0), (at, 4100.0, 20.0), (at + 0.03, 0.0, 20.0), (at, -9e3, 30.0)];
        sent.extend(more.map(|(time, frequency, snr)| pulse(time, frequency + 150.0, snr)));
    }
    sent.iter().for_each(|sent| air.add(&mut samples, 0.0, sent));
    let found = detect(&DetectorConfig::new(RATE_HZ), &samples);
    let (missed, wrong) = compare(&sent, &found);
    assert!(missed.is_empty(), "missed: {missed:#?}");
    assert!(wrong.is_empty(), "not sent: {wrong:#?}");
}

/// Clicks of one and of many samples, far above the noise, and pulses between them.
#[test]
fn clicks_are_no_pulses() {
    let mut air = Air::new(RATE_HZ, 4);
    let mut samples = air.noise(480_000);
    for n in 0..300 {
        let at = 700 + 1597 * n;
        let length = [1, 5, 30, 200][n % 4];
        for sample in &mut samples[at..at + length] {
            let angle = air.uniform(0.0, TAU) as f32;
            *sample += Complex32::from_polar(30.0, angle);
        }
    }
    let sent: Vec<_> = (0..9).map(|n| pulse(0.5 + f64::from(n), -3e3, 45.0)).collect();
    sent.iter().for_each(|sent| air.add(&mut samples, 0.0, sent));
    let found = detect(&DetectorConfig::new(RATE_HZ), &samples);
    let (missed, wrong) = compare(&sent, &found);
    assert!(missed.len() <= 1 && wrong.len() <= 1, "missed {missed:#?}, not sent {wrong:#?}");
}

/// Noise ten times as strong for as long as a pulse, over all frequencies, is known by what is
/// beside a line in it. That is sixteen cells or so, so that one burst in ten may pass.
#[test]
fn bursts_of_noise_are_no_pulses() {
    let mut air = Air::new(RATE_HZ, 15);
    let mut samples = air.noise(960_000);
    for n in 0..60 {
        let at = 20_000 + 15_013 * n;
        let length = [480, 960, 1920][n % 3];
        samples[at..at + length].iter_mut().for_each(|sample| *sample *= 10_f32.sqrt());
    }
    let found = detect(&DetectorConfig::new(RATE_HZ), &samples);
    assert!(found.len() <= 10, "{}: {found:#?}", found.len());
}

/// Tones that last more than four times as long as pulses may are no pulses, weak or strong.
#[test]
fn long_tones_are_no_pulses() {
    let mut air = Air::new(RATE_HZ, 16);
    let mut samples = air.noise(960_000);
    // Widths are searched up to 40 ms.
    for n in 0..12 {
        let time_s = 0.9 + 1.5 * n as f64;
        let width_s = [0.17, 0.25, 0.6_f64][n % 3];
        for (frequency_hz, in_40_ms_db) in [(-7e3, 18.0), (5e3, 24.0), (11e3, 35.0)] {
            let snr_db = in_40_ms_db + 10.0 * (width_s / 0.04).log10();
            air.add(&mut samples, 0.0, &Sent { time_s, frequency_hz, width_s, snr_db });
        }
    }
    let found = detect(&DetectorConfig::new(RATE_HZ), &samples);
    assert!(found.is_empty(), "{}: {found:#?}", found.len());
}

/// Carriers from weak to strong: none is a pulse, and a pulse 10 dB above a weak one is found.
#[test]
fn carriers_are_no_pulses() {
    let mut air = Air::new(RATE_HZ, 9);
    let mut samples = air.noise(960_000);
    // Energies in 20 ms of 8 to 40 dB.
    for (frequency_hz, snr_db) in [(-9e3, 8.0), (-4.5e3, 12.0), (1e3, 20.0), (8e3, 40.0)] {
        // 20 s of it.
        let snr_db = snr_db + 30.0;
        let carrier = Sent { time_s: 10.0, frequency_hz, width_s: 25.0, snr_db: snr_db + 0.97 };
        air.add(&mut samples, 0.0, &carrier);
    }
    let sent: Vec<_> = (0..9).map(|n| pulse(0.5 + 2.0 * f64::from(n), -4.5e3, 27.0)).collect();
    sent.iter().for_each(|sent| air.add(&mut samples, 0.0, sent));
    let found = detect(&DetectorConfig::new(RATE_HZ), &samples);
    let (missed, wrong) = compare(&sent, &found);
    assert!(missed.is_empty(), "missed: {missed:#?}");
    assert!(wrong.is_empty(), "not sent: {wrong:#?}");
}

/// A gap keeps the times behind it, and how samples are divided does not matter.
#[test]
fn gaps_are_in_time() {
    let mut air = Air::new(RATE_HZ, 5);
    let mut samples = air.noise(480_000);
    let sent = [1.0, 3.0, 7.0, 9.9].map(|time_s| pulse(time_s, 2e3, 25.0));
    sent.iter().for_each(|sent| air.add(&mut samples, 0.0, sent));
    let mut each = Vec::new();
    for chunk in [1_000, 77_777] {
        let mut detector = Detector::new(DetectorConfig::new(RATE_HZ)).expect("in order");
        let mut found = Vec::new();
        let mut first = 0;
        let mut lost = 0;
        for some in samples.chunks(chunk) {
            // Between 4 and 6 s samples are lost.
            if (200_000..290_000).contains(&first) {
                lost += some.len() as u64;
            } else {
                detector.push(first, some, &mut found).expect("in order");
            }
            first += some.len() as u64;
        }
        detector.finish(&mut found);
        let (missed, wrong) = compare(&sent, &found);
        assert!(missed.is_empty() && wrong.is_empty(), "{chunk}: {missed:?} {wrong:?}");
        let searched = detector.searched_s();
        assert_abs_diff_eq!(searched, (480_000 - lost) as f64 / RATE_HZ, epsilon = 0.02);
        assert!(detector.push(first - 1, &samples[..1], &mut found).is_err());
        each.push(found);
    }
    let whole = detect(&DetectorConfig::new(RATE_HZ), &samples);
    let mut detector = Detector::new(DetectorConfig::new(RATE_HZ)).expect("in order");
    let mut found = Vec::new();
    for (n, some) in (0..).zip(samples.chunks(333)) {
        detector.push(n * 333, some, &mut found).expect("in order");
    }
    detector.finish(&mut found);
    assert_eq!(found, whole);
}
