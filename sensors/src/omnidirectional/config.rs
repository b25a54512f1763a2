use foxhunt_core::parameter::{
    ParameterError, at_least_one, finite, in_range, not_negative, positive,
};

use crate::interrogation::Timing;

/// Sampling of an omnidirectional source at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct OmnidirectionalConfig {
    /// Number of requests to each beacon.
    pub questions: u16,
    /// Least time from one request to the next, in seconds.
    pub spacing_s: f64,
    /// A request without an answer after this long, in seconds, is given up.
    pub answer_timeout_s: f64,
    /// Time of the radio's measurement of the power between request (0) and answer (1).
    pub measured_at: f64,
    /// The receiver's weakest reading in dBm, where that is known.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub floor_dbm: Option<f64>,
}

impl Default for OmnidirectionalConfig {
    /// 768 requests, as many as in a stepped turn of the reference, each as soon as the last is
    /// settled; 50 ms for an answer; a power that is measured at the request.
    fn default() -> Self {
        Self {
            questions: 768,
            spacing_s: 0.0,
            answer_timeout_s: 0.05,
            measured_at: 0.0,
            floor_dbm: None,
        }
    }
}

impl OmnidirectionalConfig {
    /// Checks the ranges of all numbers.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first that is out of its range.
    pub fn check(&self) -> Result<(), ParameterError> {
        at_least_one("questions", self.questions.into())?;
        not_negative("spacing_s", self.spacing_s)?;
        positive("answer_timeout_s", self.answer_timeout_s)?;
        in_range("measured_at", self.measured_at, 0.0..=1.0, "from 0 to 1")?;
        self.floor_dbm.map_or(Ok(()), |floor| finite("floor_dbm", floor).map(|_| ()))
    }

    pub(super) fn timing(&self) -> Timing {
        Timing {
            spacing: self.spacing_s,
            answer_timeout: self.answer_timeout_s,
            measured_at: self.measured_at,
            mount_offset: 0.0,
            positions: 1,
            interval: None,
        }
    }
}
