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

/// Half-width of the band that is searched by default, over the rate: at the very edges receivers'
/// filters cut, and their clocks leave lines at half the rate.
const EDGE: f64 = 0.49;

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

/// The reason why samples cannot be searched.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DetectorError {
    /// A setting out of its range.
    #[error("{setting} is {value}, and must be {requirement}")]
    Setting {
        /// The setting.
        setting: &'static str,
        /// Its value.
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
