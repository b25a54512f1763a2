use super::TagError;

/// Settings of an association: what is known of pulses and tags beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct AssociationConfig {
    /// The shortest and the longest interval that unknown tags are searched for, in seconds.
    pub intervals_s: [f64; 2],
    /// The most by which a known tag's interval may be off its table's, as a share of it; half the
    /// width of the bins in which unknown intervals are searched.
    pub interval_tolerance: f64,
    /// The standard deviation of a pulse's measured time, in seconds.
    pub time_sigma_s: f64,
    /// The standard deviation of a pulse's measured frequency, in hertz. Where the pulses of a list
    /// stand on a coarser raster, its step takes the place of this.
    pub frequency_sigma_hz: f64,
    /// The distance of a known tag's carrier from its table's frequency, in hertz, one σ.
    pub frequency_tolerance_hz: f64,
    /// The most pulses of a train in a row that may be missed; after a longer absence a tag begins
    /// again.
    pub max_missed: u32,
    /// The mean number of unknown tags that may be found in a list of nothing but noise.
    pub false_tags: f64,
    /// The most by which a gap of a coded burst may be off, in seconds.
    pub gap_tolerance_s: f64,
    /// The most by which the whole of a coded burst may be off, in seconds.
    pub burst_tolerance_s: f64,
    /// The most by which the frequencies of a coded burst's pulses may lie apart, in hertz.
    pub burst_spread_hz: f64,
}

impl Default for AssociationConfig {
    /// Intervals of 0.2 to 5 s within 1 %, times within 1 ms, frequencies within 30 Hz and 100 Hz
    /// of the table's, 30 pulses missed, 0.001 false tags; bursts by the tolerances published for
    /// the tag finder of SensorGnome (Brzustowski, `find_tags_motus`): 1.5 ms a gap, 4 ms a burst,
    /// 0.5 kHz.
    fn default() -> Self {
        Self {
            intervals_s: [0.2, 5.0],
            interval_tolerance: 0.01,
            time_sigma_s: 1e-3,
            frequency_sigma_hz: 30.0,
            frequency_tolerance_hz: 100.0,
            max_missed: 30,
            false_tags: 1e-3,
            gap_tolerance_s: 1.5e-3,
            burst_tolerance_s: 4e-3,
            burst_spread_hz: 500.0,
        }
    }
}

impl AssociationConfig {
    pub(super) fn check(&self) -> Result<(), TagError> {
        let positive = [
            ("time_sigma_s", self.time_sigma_s),
            ("frequency_sigma_hz", self.frequency_sigma_hz),
            ("frequency_tolerance_hz", self.frequency_tolerance_hz),
            ("false_tags", self.false_tags),
            ("gap_tolerance_s", self.gap_tolerance_s),
            ("burst_tolerance_s", self.burst_tolerance_s),
            ("burst_spread_hz", self.burst_spread_hz),
            ("intervals_s[0]", self.intervals_s[0]),
        ];
        let refuse =
            |name, value, requirement| Err(TagError::Parameter { name, value, requirement });
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return refuse(name, value, "finite and above 0");
            }
        }
        let [shortest, longest] = self.intervals_s;
        if !(longest.is_finite() && longest > shortest) {
            return refuse("intervals_s[1]", longest, "finite and above intervals_s[0]");
        }
        if !(1e-4..=0.1).contains(&self.interval_tolerance) {
            return refuse("interval_tolerance", self.interval_tolerance, "0.0001 to 0.1");
        }
        Ok(())
    }
}
