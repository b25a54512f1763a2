use foxhunt_core::parameter::{ParameterError, in_range, not_negative};
use serde::{Deserialize, Serialize};

/// A time from one second of the simulation to another, which does not belong to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// Its first second.
    pub from_s: f64,
    /// The second at which it is over; if absent, it never is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
}

impl Interval {
    /// Returns true if the interval contains a moment.
    #[must_use]
    pub fn contains(&self, time: f64) -> bool {
        self.from_s <= time && self.to_s.is_none_or(|end| time < end)
    }

    pub(crate) fn check(&self) -> Result<(), ParameterError> {
        not_negative("from_s", self.from_s)?;
        let range = self.from_s..=f64::MAX;
        let requirement = "a finite number that is not below from_s";
        in_range("to_s", self.to_s.unwrap_or(self.from_s), range, requirement)?;
        Ok(())
    }
}
