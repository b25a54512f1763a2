use foxhunt_signal::{
    Complex32,
    detector::{Detection, Detector, DetectorConfig, DetectorError},
    samples::SampleFormat,
};

use super::{PulseConfig, RtlTcpConfig, config::SEARCH_EVERY_S};

/// The pulses in the samples of a receiver that is tuned to a frequency.
#[derive(Debug)]
pub(super) struct PulseWatch {
    detector: Detector,
    pulse: PulseConfig,
    rate_hz: f64,
    /// Samples before this index are left out: the receiver was not there yet.
    from: u64,
    samples: Vec<Complex32>,
    found: Vec<Detection>,
}

impl PulseWatch {
    /// Watches these frequencies, from a sample on.
    pub(super) fn new(
        config: &RtlTcpConfig,
        pulse: PulseConfig,
        center_hz: u32,
        watched_hz: [u32; 2],
        from: u64,
    ) -> Result<Self, DetectorError> {
        let rate_hz = f64::from(config.sample_rate_hz);
        let [lowest, highest] = watched_hz.map(f64::from);
        let mut detector = DetectorConfig::new(rate_hz);
        detector.center_hz = Some(f64::from(center_hz));
        detector.band_hz = Some([lowest - pulse.search_hz, highest + pulse.search_hz]);
        detector.widths_s = vec![pulse.width_s];
        detector.false_alarms_per_hour = pulse.false_alarms_per_hour;
        detector.least_noise = SampleFormat::Cu8.rounding_noise();
        detector.full_scale_dbm = config.full_scale_dbm;
        detector.search_every_s = Some(SEARCH_EVERY_S);
        let detector = Detector::new(detector)?;
        Ok(Self { detector, pulse, rate_hz, from, samples: Vec::new(), found: Vec::new() })
    }

    /// Takes bytes, the first sample of which has an index.
    pub(super) fn push(&mut self, first: u64, bytes: &[u8]) -> Result<(), DetectorError> {
        let early = usize::try_from(self.from.saturating_sub(first)).unwrap_or(usize::MAX);
        let bytes = bytes.get(early.saturating_mul(2)..).unwrap_or_default();
        if bytes.is_empty() {
            return Ok(());
        }
        self.samples.clear();
        SampleFormat::Cu8.decode(bytes, &mut self.samples);
        self.detector.push(first.max(self.from), &self.samples, &mut self.found)
    }

    /// Searches the remaining samples: nothing comes that belongs to them.
    pub(super) fn finish(&mut self) {
        self.detector.finish(&mut self.found);
    }

    /// Returns true if the noise is known, so that pulses are found soon after they came.
    pub(super) fn is_ready(&self) -> bool {
        self.detector.searched_s() > 0.0
    }

    /// The power in dBm that a pulse at a frequency must have to be found, once that is known.
    pub(super) fn floor_dbm(&self, frequency_hz: u32) -> Option<f64> {
        self.detector.floor_dbm(f64::from(frequency_hz), self.pulse.width_s)
    }

    /// The first pulse that begins at a sample or later and is `of` the tag that is sought: its
    /// level in dBm, and the sample in its middle. All that were found are given up.
    pub(super) fn take(&mut self, from: u64, of: impl Fn(f64) -> bool) -> Option<(f64, f64)> {
        #[expect(clippy::cast_precision_loss, reason = "below 2^52")]
        let from = from as f64;
        let pulses = self.found.drain(..).map(|detection| detection.pulse);
        let mut pulses = pulses.filter(|pulse| {
            // Its ends are known to a small part of its length.
            let begin = pulse.time_s - 0.5 * pulse.width_s + 0.1 * self.pulse.width_s;
            begin * self.rate_hz >= from && of(pulse.frequency_hz)
        });
        let pulse = pulses.next()?;
        Some((pulse.power_dbm, pulse.time_s * self.rate_hz))
    }
}
