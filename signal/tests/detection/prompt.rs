//! Pulses that are wanted soon, and the weakest ones that are found.

use approx::assert_abs_diff_eq;
use foxhunt_signal::detector::{Detection, Detector, DetectorConfig};

use super::air::{Air, Sent, detect};

const RATE_HZ: f64 = 16e3;

/// Samples of 30 s with a pulse of 20 ms each 1.3 s.
fn tag(snr_db: f64) -> (Vec<Sent>, Vec<rustfft::num_complex::Complex32>) {
    let mut air = Air::new(RATE_HZ, 11);
    let mut samples = air.noise(480_000);
    let sent = |n: u32| {
        let time_s = 1.7 + 1.3 * f64::from(n);
        Sent { time_s, frequency_hz: 2150.0, width_s: 20e-3, snr_db }
    };
    let sent: Vec<_> = (0..21).map(sent).collect();
    sent.iter().for_each(|sent| air.add(&mut samples, 0.0, sent));
    (sent, samples)
}

fn config() -> DetectorConfig {
    let mut config = DetectorConfig::new(RATE_HZ);
    config.widths_s = vec![20e-3];
    config
}

/// Searched often, each pulse is given within its length and 0.2 s, once, and is the one that is
/// given later otherwise.
#[test]
fn pulses_are_given_soon() {
    let (sent, samples) = tag(20.0);
    let later = detect(&config(), &samples);
    let mut prompt = config();
    prompt.search_every_s = Some(0.05);
    let mut detector = Detector::new(prompt).expect("it is in order");
    let mut given: Vec<(f64, Detection)> = Vec::new();
    let mut found = Vec::new();
    for (place, chunk) in samples.chunks(160).enumerate() {
        detector.push(160 * place as u64, chunk, &mut found).expect("indices rise");
        let now = 0.01 * (place + 1) as f64;
        given.extend(found.drain(..).map(|detection| (now, detection)));
    }
    assert_eq!((given.len(), later.len()), (sent.len(), sent.len()));
    for ((now, soon), late) in given.iter().zip(&later) {
        let delay = now - soon.pulse.time_s - 10e-3;
        assert!((0.0..0.2).contains(&delay), "{delay} s after its end");
        assert_abs_diff_eq!(soon.pulse.time_s, late.pulse.time_s, epsilon = 1e-4);
        assert_abs_diff_eq!(soon.pulse.power_dbm, late.pulse.power_dbm, epsilon = 0.1);
    }
}

/// Half of the pulses that are 1.5 dB below the floor are missed at least, and few that are 3 dB
/// above it.
#[test]
fn the_floor_is_where_pulses_are_missed() {
    let mut detector = Detector::new(config()).expect("it is in order");
    assert_eq!(detector.floor_dbm(2150.0, 20e-3), None);
    let (_, noise) = tag(-20.0);
    let mut found = Vec::new();
    detector.push(0, &noise, &mut found).expect("indices rise");
    let floor = detector.floor_dbm(2150.0, 20e-3).expect("the noise is known");
    assert_eq!(detector.floor_dbm(9000.0, 20e-3), None, "beyond the band");
    // A power of 1 a sample: over 320 samples a pulse has 25.1 dB more energy.
    let snr_db = floor + 10.0 * 320_f64.log10();
    for (above, least, most) in [(-1.5, 0, 10), (3.0, 19, 21)] {
        let (_, samples) = tag(snr_db + above);
        let count = detect(&config(), &samples).len();
        assert!((least..=most).contains(&count), "{count} of 21 at {above} dB");
    }
}
