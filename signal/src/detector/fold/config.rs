use super::super::{DetectorConfig, DetectorError};

/// Settings of a search for trains.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct FoldConfig {
    /// The samples, the band, how long pulses may be, and how many times an hour noise may be taken
    /// for a train, over all of it.
    pub detector: DetectorConfig,
    /// The number of pulses that are added up. A train may be longer, and some may be missing.
    pub pulses: usize,
    /// The shortest and the longest interval, in seconds; both the same where it is known.
    pub intervals_s: [f64; 2],
    /// The steepest drift of a carrier, up or down, in hertz a second.
    pub drift_hz_per_s: f64,
}

impl FoldConfig {
    /// Pulses of 20 ms, the other settings of [`DetectorConfig::new`], and drifts up to 1 Hz a
    /// second, as a receiver has that warms up.
    #[must_use]
    pub fn new(rate_hz: f64, pulses: usize, intervals_s: [f64; 2]) -> Self {
        let mut detector = DetectorConfig::new(rate_hz);
        detector.widths_s = vec![20e-3];
        Self { detector, pulses, intervals_s, drift_hz_per_s: 1.0 }
    }

    pub(super) fn check(&self) -> Result<(), DetectorError> {
        let refuse = |setting, value, requirement| {
            Err(DetectorError::Setting { setting, value, requirement })
        };
        if !(3..=64).contains(&self.pulses) {
            let pulses = u32::try_from(self.pulses).unwrap_or(u32::MAX);
            return refuse("pulses", pulses.into(), "3 to 64");
        }
        let (_, wide) = self.detector.narrow_and_wide();
        let [shortest, longest] = self.intervals_s;
        if !(shortest.is_finite() && shortest >= 3.0 * wide) {
            return refuse("intervals_s[0]", shortest, "at least three times the widest pulse");
        }
        if !(longest.is_finite() && longest >= shortest) {
            return refuse("intervals_s[1]", longest, "finite and not below intervals_s[0]");
        }
        if self.span_s() > 300.0 {
            return refuse("intervals_s[1]", longest, "such that all pulses are within 300 s");
        }
        let drift = self.drift_hz_per_s;
        if !(drift >= 0.0 && drift * self.span_s() <= 1000.0) {
            return refuse("drift_hz_per_s", drift, "0 or more, and at most 1 kHz in a train");
        }
        Ok(())
    }

    /// Time from the first to the last of the pulses that are added up, at most.
    pub(super) fn span_s(&self) -> f64 {
        super::super::channeliser::float(self.pulses.saturating_sub(1)) * self.intervals_s[1]
    }
}
