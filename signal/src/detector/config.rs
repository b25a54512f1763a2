//! Settings of detectors, their detections, and the rate at which noise alone gives them.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use serde::Serialize;

use super::channeliser::float;
use crate::Pulse;

/// Half-width of the band that is searched by default, over the rate: at the very edges receivers'
/// filters cut, and their clocks leave lines at half the rate.
const EDGE: f64 = 0.49;

/// Settings of a detector: the samples, the band, the widths of pulses and the rate of false
/// alarms.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct DetectorConfig {
    /// Samples per second.
    pub rate_hz: f64,
    /// The frequency in the middle of the band; without it frequencies are relative to it.
    pub center_hz: Option<f64>,
    /// The lowest and highest frequency searched, in the terms of `center_hz`; without it all but
    /// the outermost 1 % on each side.
    pub band_hz: Option<[f64; 2]>,
    /// The durations of pulses; each pulse is found by the window nearest to its length, and one
    /// that is √2 longer or shorter loses 1.5 dB.
    pub widths_s: Vec<f64>,
    /// The rate per hour at which noise may be taken for a pulse, over all frequencies and widths.
    pub false_alarms_per_hour: f64,
    /// The least power of noise in a sample, over that of a tone at full scale: that of the steps
    /// of the samples' numbers, below which nothing is known. Recordings that are muted between
    /// transmissions have no other.
    pub least_noise: f64,
    /// The power of a tone at full scale, in dBm; 0 where it is not known, for dB of full scale.
    pub full_scale_dbm: f64,
    /// Time from one search to the next, in seconds, once the noise is known: a pulse is given that
    /// much and three of the longest windows later. If absent, searches come with the noise, each
    /// second.
    pub search_every_s: Option<f64>,
}

impl DetectorConfig {
    /// The band around an unknown centre, widths of 2.5, 5, 10, 20 and 40 ms, one false alarm an
    /// hour, levels in dB of full scale, noise down to −120 dB.
    #[must_use]
    pub fn new(rate_hz: f64) -> Self {
        Self {
            rate_hz,
            center_hz: None,
            band_hz: None,
            widths_s: vec![2.5e-3, 5e-3, 10e-3, 20e-3, 40e-3],
            false_alarms_per_hour: 1.0,
            least_noise: 1e-12,
            full_scale_dbm: 0.0,
            search_every_s: None,
        }
    }

    pub(super) fn check(&self) -> Result<(), DetectorError> {
        let refuse = |what, value, requirement| {
            Err(DetectorError::Setting { setting: what, value, requirement })
        };
        if !(self.rate_hz.is_finite() && self.rate_hz >= 100.0) {
            return refuse("rate_hz", self.rate_hz, "finite and at least 100");
        }
        if let Some(center) = self.center_hz.filter(|center| !center.is_finite()) {
            return refuse("center_hz", center, "finite");
        }
        if self.widths_s.is_empty() {
            return refuse("widths_s", 0.0, "at least one width");
        }
        for width in &self.widths_s {
            if !(16.0 / self.rate_hz..=10.0).contains(width) {
                return refuse("widths_s", *width, "at least 16 samples and at most 10 s");
            }
        }
        let (narrow, wide) = self.narrow_and_wide();
        if wide > 64.0 * narrow {
            return refuse("widths_s", wide, "at most 64 times the narrowest");
        }
        if let Some([low, high]) = self.band_hz {
            let center = self.center_hz.unwrap_or(0.0);
            let inside = [low - center, high - center].map(|f| f.abs() <= self.rate_hz / 2.0);
            if !inside[0] || !inside[1] {
                let outside = if inside[0] { high } else { low };
                return refuse("band_hz", outside, "within half the rate of the centre");
            }
            if high - low < 4.0 / narrow {
                return refuse("band_hz", high - low, "at least 4 over the narrowest width wide");
            }
        }
        let rate = self.false_alarms_per_hour;
        if !(1e-9..=1e6).contains(&rate) {
            return refuse("false_alarms_per_hour", rate, "1e-9 to 1e6");
        }
        if !(1e-18..1.0).contains(&self.least_noise) {
            return refuse("least_noise", self.least_noise, "1e-18 to 1");
        }
        if !self.full_scale_dbm.is_finite() {
            return refuse("full_scale_dbm", self.full_scale_dbm, "finite");
        }
        if let Some(every) = self.search_every_s
            && (every.is_nan() || every <= 0.0)
        {
            return refuse("search_every_s", every, "above 0");
        }
        Ok(())
    }

    /// The narrowest and the widest window.
    pub(super) fn narrow_and_wide(&self) -> (f64, f64) {
        let each = || self.widths_s.iter().copied();
        (each().fold(f64::INFINITY, f64::min), each().fold(0.0, f64::max))
    }

    /// The band that is searched, relative to the centre.
    pub(super) fn band_about_center(&self) -> [f64; 2] {
        let center = self.center_hz.unwrap_or(0.0);
        match self.band_hz {
            Some(band) => band.map(|f| f - center),
            None => [-EDGE * self.rate_hz, EDGE * self.rate_hz],
        }
    }
}

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
        float(self.pulses.saturating_sub(1)) * self.intervals_s[1]
    }
}

/// The reason why samples cannot be searched.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DetectorError {
    /// A setting out of its range.
    #[error("{setting} is {value}; it must be {requirement}")]
    Setting {
        /// The setting.
        setting: &'static str,
        /// Value of the setting.
        value: f64,
        /// The requirement on the value.
        requirement: &'static str,
    },
    /// Samples that were searched already.
    #[error("samples begin at {first}, and those up to {expected} were searched already")]
    Backwards {
        /// Index of their first sample.
        first: u64,
        /// The least index that they may begin at.
        expected: u64,
    },
}

/// A pulse, and how likely noise alone is to look so.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Detection {
    /// The pulse.
    #[serde(flatten)]
    pub pulse: Pulse,
    /// The rate per hour at which noise alone is at least as strong, anywhere in what is searched.
    pub false_alarms_per_hour: f64,
}

impl Detection {
    /// The probability that noise alone gives a detection at least as strong while `searched_s`
    /// seconds are searched, over all frequencies and widths.
    #[must_use]
    pub fn p_value(&self, searched_s: f64) -> f64 {
        -(-self.false_alarms_per_hour * searched_s / 3600.0).exp_m1()
    }
}

/// The rate at which noise alone exceeds a threshold somewhere, when a pulse-long window slides
/// over all times and frequencies.
///
/// The statistic is a window's energy over the noise's, X = |Σ x e^{−iωt}|² / (n N),
/// exponential under noise. Its maxima above a high T come at a rate that the correlation of
/// neighbours gives: in frequency |r| ≈ 1 − (π w δ)²/6, smooth, with √(πT/3) w
/// upcrossings a hertz (Rice 1944); in time |r| = 1 − |τ|/w, with 2T/w a second (Pickands 1969),
/// less by ν(√(4T/n)) as windows begin at samples only, n to a window (Siegmund 1985). So λ = B
/// · 2 √(π/3) T^{3/2} ν P(X > T), whatever the width. The noise's level is an estimate worth k
/// exponentials, so that P(X > T) is (1 + T/k)^−k (Finn & Johnson 1968). Rates of several widths
/// add, which is above the truth as widths share noise.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FalseAlarms {
    band_hz: f64,
    /// Samples in the window of each width.
    windows: Vec<usize>,
}

impl FalseAlarms {
    pub(super) fn new(band_hz: f64, windows: Vec<usize>) -> Self {
        Self { band_hz, windows }
    }

    /// The number of noise's maxima above the threshold, a second; the level of the noise is worth
    /// `known` exponentials.
    pub(super) fn rate_hz(&self, threshold: f64, known: f64) -> f64 {
        let nu = |n: &usize| discrete((4.0 * threshold / float(*n)).sqrt());
        let beyond = (-known * (threshold / known).ln_1p()).exp();
        let each: f64 = self.windows.iter().map(nu).sum();
        self.band_hz * 2.0 * (PI / 3.0).sqrt() * threshold.powf(1.5) * beyond * each
    }

    /// The threshold that noise exceeds `rate_hz` times a second.
    pub(super) fn threshold(&self, rate_hz: f64, known: f64) -> f64 {
        // The rate falls above 1.5, where T^{3/2} e^−T is highest.
        let mut low = 2.0;
        let mut high = 2000.0;
        for _ in 0..60 {
            let middle = (low + high) / 2.0;
            if self.rate_hz(middle, known) > rate_hz {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }
}

/// The rate at which a random walk of steps x exceeds a level, over that of a continuous one
/// (Siegmund 1985; the closed form of Siegmund & Yakir 2007).
pub(super) fn discrete(x: f64) -> f64 {
    let half = x / 2.0;
    let above = 0.5 * libm::erf(half * FRAC_1_SQRT_2);
    let density = (-half * half / 2.0).exp() / (2.0 * PI).sqrt();
    (above / half) / (half * (0.5 + above) + density)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    #[test]
    fn steps_make_maxima_rarer() {
        // exp(−0.583 x) for small steps (Siegmund 1985, equation 4.38).
        for x in [0.1_f64, 0.5, 1.0] {
            assert_abs_diff_eq!(discrete(x) / (-0.583 * x).exp(), 1.0, epsilon = 0.02);
        }
    }

    #[test]
    fn a_threshold_has_its_rate() {
        let alarms = FalseAlarms::new(4e3, vec![120, 240]);
        for rate in [1e-6, 1e-3, 1.0] {
            for known in [100.0, 1e4] {
                let threshold = alarms.threshold(rate, known);
                let back = alarms.rate_hz(threshold, known);
                assert!(abs_diff_eq!(back / rate, 1.0, epsilon = 1e-6), "{rate} {known}: {back}");
            }
        }
        let known = alarms.threshold(1e-3, 1e6);
        assert!((20.0..22.0).contains(&known), "{known}");
        assert!(alarms.threshold(1e-3, 500.0) > known + 0.3, "an unknown level costs");
    }
}
