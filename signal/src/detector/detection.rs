use serde::Serialize;

use crate::Pulse;

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
