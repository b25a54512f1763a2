//! Any bytes as samples: SigMF metadata, a WAV file, raw samples. The first byte chooses the format
//! and how the stream is divided; of few inputs the samples are searched for pulses and trains.
#![no_main]

use std::io::{self, Cursor, Read};

use foxhunt_signal::{
    Complex32,
    detector::{Detector, DetectorConfig, FoldConfig, TrainDetector},
    samples::{SampleFormat, SampleSource, SigMf},
};
use libfuzzer_sys::fuzz_target;

/// Reader that gives at most this number of bytes at once.
struct Divided(Cursor<Vec<u8>>, usize);

impl Read for Divided {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let most = into.len().min(self.1);
        self.0.read(&mut into[..most])
    }
}

fn all(mut source: SampleSource, bytes: usize) -> Vec<Complex32> {
    let mut chunk = Vec::new();
    let mut all = Vec::new();
    while let Ok(Some(first)) = source.read(&mut chunk) {
        assert_eq!(first, all.len() as u64, "a place in time");
        assert!(!chunk.is_empty());
        all.append(&mut chunk);
    }
    assert!(all.len() <= bytes);
    assert!(all.iter().all(|sample| sample.re.is_finite() && sample.im.is_finite()));
    all
}

fn searched(samples: &[Complex32]) {
    let mut config = DetectorConfig::new(8e3);
    config.widths_s = vec![5e-3];
    let mut detector = Detector::new(config).expect("it is in order");
    let mut found = Vec::new();
    detector.push(0, samples, &mut found).expect("in order");
    detector.finish(&mut found);
    assert!(found.iter().all(|found| found.pulse.time_s.is_finite()));
    let mut config = FoldConfig::new(8e3, 3, [0.05, 0.06]);
    config.detector.widths_s = vec![5e-3];
    let mut detector = TrainDetector::new(config).expect("it is in order");
    let mut found = Vec::new();
    detector.push(0, samples, &mut found).expect("in order");
    detector.finish(&mut found);
    assert!(found.iter().all(|train| train.interval_s.is_finite()));
}

fuzz_target!(|bytes: &[u8]| {
    if let Ok(text) = std::str::from_utf8(bytes)
        && let Ok(sigmf) = SigMf::parse("fuzz.sigmf-meta", text)
    {
        assert!(sigmf.rate_hz > 0.0 && sigmf.rate_hz.is_finite());
        assert!(sigmf.jumps.iter().is_sorted_by_key(|(at, index)| (*at, *index)));
    }
    let Some((first, bytes)) = bytes.split_first() else { return };
    let divided = usize::from(*first >> 4) + 1;
    let input = |most: usize| Box::new(Divided(Cursor::new(bytes.to_vec()), most));
    if let Ok(source) = SampleSource::wav("fuzz.wav", input(usize::MAX), None) {
        assert!(source.rounding_noise() > 0.0);
        let whole = all(source, bytes.len());
        let again = SampleSource::wav("fuzz.wav", input(divided), None).expect("it was read");
        assert_eq!(all(again, bytes.len()), whole, "division matters");
    }
    let format = SampleFormat::ALL[usize::from(*first) % SampleFormat::ALL.len()];
    let raw = |most| SampleSource::raw("fuzz", input(most), format, 8e3, None);
    let whole = all(raw(usize::MAX).expect("a rate"), bytes.len());
    assert_eq!(all(raw(divided).expect("a rate"), bytes.len()), whole, "division matters");
    if bytes.len() % 16 == 0 {
        searched(&whole);
    }
});
